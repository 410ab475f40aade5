"""Measures of a shape against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from tubes import CIRCLE, straight

from naisr_model.measures.kinds import MEASURES, anchor, distance, measured, surface_of


def test_a_ball(ball):
    values = measured(surface_of(ball))
    assert values.keys() == {"volume", "area"}
    assert values["volume"] == pytest.approx(4 / 3 * np.pi, rel=1e-3)  # cm³
    assert values["area"] == pytest.approx(4 * np.pi, rel=5e-3)  # cm²


def test_a_tube():
    values = measured(surface_of(straight(np.full(101, 5.0))))
    assert values["length"] == pytest.approx(100, rel=1e-3)
    assert values["narrowest"] == pytest.approx(25 * CIRCLE, rel=1e-3)
    assert values["area"] == pytest.approx((2 * np.pi * 5 * 100 + 2 * np.pi * 25) / 100, rel=5e-3)


def test_what_is_open_has_no_volume(ball):
    half = ball.copy()
    half.update_faces(half.triangles_center[:, 2] > 0)
    assert measured(surface_of(half)).keys() == {"area"}


def test_every_measure_says_what_it_is():
    for name, measure in MEASURES.items():
        assert measure.name == name and measure.title and measure.unit and measure.definition


def test_two_points_of_the_material_stay_where_they_are_in_it(ball):
    surface = surface_of(ball)
    ends = [anchor(surface, point) for point in ([0, 0, 12.0], [0, 0, -12.0])]
    across = distance(*ends)
    assert across.is_possible(surface) and across.of(surface) == pytest.approx(20, rel=2e-3)
    taller = surface.moved(ball.vertices * [1, 1, 1.5])
    assert across.of(taller) == pytest.approx(30, rel=2e-3)
    assert not across.is_possible(surface_of(trimesh.creation.box()))


def test_an_anchor_lies_within_its_triangle(ball):
    surface = surface_of(ball)
    rng = np.random.default_rng(0)
    for point in 10 * trimesh.unitize(rng.normal(size=(10, 3))):
        place = anchor(surface, point).place_mm(surface)
        assert np.linalg.norm(place - point) < 0.05
