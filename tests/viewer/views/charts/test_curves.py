"""The curve of a measure, used with mouse and keys."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QWidget

from naisr_viewer.state.curves import CurveRequest, Curves, MeasureCurve, Sighting
from naisr_viewer.views.charts.curves import CurveChart, picture
from naisr_viewer.views.charts.draggable import SETTLE_MS
from naisr_viewer.views.theme import DARK, LIGHT
from naisr_viewer.words.curves import told

LEFT = Qt.MouseButton.LeftButton
PLACES = np.linspace(1.0, 220.0, 25)
VOLUME = MeasureCurve(
    "volume",
    "Volume",
    "cm³",
    "inside",
    usual=PLACES / 2,
    path=PLACES,
    band=(PLACES / 3, 2 * PLACES / 3),
    sure=(PLACES / 2.2, PLACES / 1.8),
    observed=np.array([20.0, 60.0]),
    own=PLACES / 2.5,
    sighting=Sighting(84.0, 33.0, 2.0),
)
CURVES = Curves(CurveRequest(Path("a"), "age", (), 1), PLACES, np.array([40.0, 120.0]), (VOLUME,))
COLOURS = ("#e29a3b", "#d6453d")


@pytest.fixture
def chart(qtbot, atlas) -> CurveChart:
    around = QWidget()
    around.resize(420, 150)
    qtbot.addWidget(around)
    chart = CurveChart(around)
    chart.resize(420, 150)
    chart.set_theme(LIGHT)
    chart.show_curve(atlas.covariates[0], CURVES, VOLUME, COLOURS)
    chart.show_place(100.0)
    with qtbot.waitExposed(around):
        around.show()
    chart.around = around
    return chart


@pytest.fixture
def heard(chart) -> list[tuple[str, float]]:
    """What it says, and whoever hears it puts the line there."""
    acts: list[tuple[str, float]] = []
    chart.moved.connect(lambda place: acts.append(("moved", *place)))
    chart.moved.connect(lambda place: chart.show_place(*place))
    chart.settled.connect(lambda place: acts.append(("settled", *place)))
    return acts


def at(chart: CurveChart, value: float) -> QPoint:
    return QPoint(round(chart.place_of(value).x()), chart.height() // 2)


def test_the_line_is_dragged_and_does_not_jump_under_the_pointer(chart, heard):
    start, aside = at(chart, 100), QPoint(4, 0)
    QTest.mousePress(chart.viewport(), LEFT, pos=start + aside)
    assert heard == []
    QTest.mouseMove(chart.viewport(), at(chart, 180) + aside)
    QTest.mouseRelease(chart.viewport(), LEFT, pos=at(chart, 180) + aside)
    assert [kind for kind, _ in heard] == ["moved", "settled"]
    assert heard[-1][1] == pytest.approx(180, abs=1) and heard[-1][1] == round(heard[-1][1])


def test_a_click_brings_the_line_and_a_drag_ends_with_the_range(chart, heard):
    QTest.mouseClick(chart.viewport(), LEFT, pos=at(chart, 40))
    assert heard[-1] == ("settled", pytest.approx(40, abs=1))
    QTest.mouseClick(chart.viewport(), Qt.MouseButton.RightButton, pos=at(chart, 150))
    assert heard[-1][1] < 50
    QTest.mousePress(chart.viewport(), LEFT, pos=at(chart, 40))
    QTest.mouseMove(chart.viewport(), QPoint(3000, 40))
    QTest.mouseRelease(chart.viewport(), LEFT, pos=QPoint(3000, 40))
    assert heard[-1] == ("settled", 220.0)


def test_arrow_keys_move_the_line_and_are_one_act(chart, heard, qtbot):
    for _ in range(3):
        QTest.keyClick(chart, Qt.Key.Key_Right)
    assert [kind for kind, _ in heard] == ["moved"] * 3
    qtbot.waitUntil(lambda: heard[-1][0] == "settled", timeout=5 * SETTLE_MS)
    assert heard[-1][1] > 104


def test_a_forgotten_movement_settles_nothing(chart, heard):
    QTest.mousePress(chart.viewport(), LEFT, pos=at(chart, 150))
    chart.forget_move()
    QTest.mouseRelease(chart.viewport(), LEFT, pos=at(chart, 150))
    assert [kind for kind, _ in heard] == ["moved"]


def test_a_picture_has_its_axes_told_and_no_pixels(chart, qtbot):
    chart.set_theme(DARK)
    chart.set_theme(LIGHT)
    svg = picture(chart).decode()
    assert "Volume, cm³" in svg and "Age, months" in svg and "<image" not in svg


def test_what_is_not_known_is_not_told(atlas):
    age = atlas.covariates[0]
    assert told(age, CURVES, VOLUME, 84.0) == (
        "Age 84 months: 42.0 cm³\n95 % sure: 38.2 to 46.7\n"
        "95 % of people: 28.0 to 56.0\nThis patient: 33.6 cm³"
    )
    bare = dataclasses.replace(VOLUME, band=None, sure=None, own=None)
    assert told(age, CURVES, bare, 84.0) == "Age 84 months: 42.0 cm³"
