"""The letters of the body's axes stand where those sides of the body are."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from PySide6.QtWidgets import QWidget

from naisr_viewer.views.shapes.camera import DIRECTIONS, OBLIQUE, axes_of
from naisr_viewer.views.shapes.compass import Compass, ends

RIGHT_UP_LEFT_DOWN = ((1, 0), (0, 1), (-1, 0), (0, -1))


@pytest.fixture
def parent(qtbot) -> QWidget:
    widget = QWidget()
    qtbot.addWidget(widget)
    return widget


@pytest.fixture
def compass(parent) -> Compass:
    return Compass(parent)


def letters(compass: Compass, direction) -> dict[str, tuple[float, float]]:
    camera = pv.Camera()
    camera.focal_point, (camera.position, camera.up) = (0, 0, 0), direction
    right, up = axes_of(camera)
    compass.show_ends(ends(right.tolist(), up.tolist()))
    return compass.letters


@pytest.mark.parametrize(
    ("name", "around"),
    [
        ("the front", "LSRI"),  # facing the body, its left is at our right
        ("the back", "RSLI"),
        ("the left", "PSAI"),
        ("the right", "ASPI"),
        ("above", "RALP"),
        ("below", "LARP"),
    ],
)
def test_standard_views_have_four_letters_around(compass, name, around):
    found = letters(compass, DIRECTIONS[name])
    assert set(found) == set(around)
    for letter, place in zip(around, RIGHT_UP_LEFT_DOWN, strict=True):
        assert found[letter] == pytest.approx(place, abs=1e-9)


def test_what_points_away_is_left_out(compass):
    found = letters(compass, OBLIQUE)
    assert "R" not in found and {"A", "P", "S", "I"} <= set(found)
    assert np.hypot(*found["L"]) < 0.6
