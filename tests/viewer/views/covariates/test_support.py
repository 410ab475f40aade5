"""The data beneath the sliders and along them, alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor
from PySide6.QtTest import QTest
from pytestqt.qtbot import QtBot

from naisr_viewer.program.headless import pause
from naisr_viewer.state.explorer import ExplorerState, opened, with_patient, with_values
from naisr_viewer.state.patients import OpenScan, Reading, Scan
from naisr_viewer.state.support import Support
from naisr_viewer.views.colours import patient_colour
from naisr_viewer.views.covariates.panel import PANEL_WIDTH, CovariatePanel
from naisr_viewer.views.covariates.slider import share_of, track_x
from naisr_viewer.views.theme import LIGHT

HIGH_PX, LOW_PX = 900, 420


@pytest.fixture
def panel(qtbot: QtBot, card) -> CovariatePanel:
    panel = CovariatePanel()
    qtbot.addWidget(panel)
    panel.show_atlas(card, LIGHT)
    panel.show_values(opened(ExplorerState(), card))
    panel.resize(PANEL_WIDTH, HIGH_PX)
    with qtbot.waitExposed(panel):
        panel.show()
    panel.support.prepare()
    return panel


@pytest.fixture
def asked(panel) -> list[Support]:
    found: list[Support] = []
    panel.support_requested.connect(found.append)
    return found


def test_the_data_are_folded_where_there_is_no_room(panel, card, qtbot):
    support = panel.support
    assert support.chart.isVisible()
    panel.resize(PANEL_WIDTH, LOW_PX)
    qtbot.waitUntil(lambda: not support.chart.isVisible())
    panel.resize(PANEL_WIDTH, HIGH_PX)
    qtbot.waitUntil(support.chart.isVisible)
    panel.show_values(replace(opened(ExplorerState(), card), support=Support("age", "weight", False)))
    assert not support.chart.isVisible()
    panel.resize(PANEL_WIDTH, LOW_PX)
    panel.show_values(replace(opened(ExplorerState(), card), support=Support("age", "weight", True)))
    assert support.chart.isVisible()  # to be scrolled to; the sliders keep their place
    slider = panel.rows["age"].slider
    qtbot.waitUntil(lambda: slider.visibleRegion().boundingRect() == slider.rect())


def test_folding_and_axes_are_asked_for(panel, asked, card):
    QTest.mouseClick(panel.support.fold, Qt.MouseButton.LeftButton)
    assert asked == [Support("age", "weight", False)] and panel.support.chart.isVisible()
    QTest.keyClick(panel.support.along, Qt.Key.Key_Down)  # from age to weight: they change places
    assert asked[-1] == Support("weight", "age")
    panel.show_values(replace(opened(ExplorerState(), card), support=Support("sex", "weight")))
    assert [panel.support.along.currentText(), panel.support.upwards.currentText()] == ["Sex", "Weight"]
    assert len(asked) == 2


def test_an_atlas_of_one_covariate_has_no_scatter(panel, card):
    population = card.population.keeping({"age"})
    of_one = replace(card, covariates=population.covariates, population=population)
    panel.show_atlas(of_one, LIGHT)
    panel.show_values(opened(ExplorerState(), of_one))
    assert not panel.support.isVisible()


def test_the_ring_moves_both_covariates(panel, card):
    moved: list[tuple] = []
    panel.values_settled.connect(moved.append)
    chart = panel.support.chart
    QTest.mouseClick(chart.viewport(), Qt.MouseButton.LeftButton, pos=chart.place_of(160, 50).toPoint())
    (((x, age), (y, weight)),) = moved
    assert (x, y) == ("age", "weight")
    assert (age, weight) == pytest.approx((160, 50), abs=1.5)


@pytest.mark.parametrize("weight", [20.0, 60.0, 95.0])
def test_the_groove_is_solid_where_there_are_data(panel, card, weight):
    """Pixels along the groove of age against what the population says of each place."""
    state = with_values(opened(ExplorerState(), card), (("age", 1.0), ("weight", weight)))
    panel.show_values(state)
    slider, age = panel.rows["age"].slider, card.covariates[0]
    image = slider.grab().toImage()
    ratio, middle = image.devicePixelRatio(), image.height() // 2
    for value in np.linspace(1, 220, 60)[8:]:  # clear of the handle
        x = round(track_x(share_of(age, value), slider.width()) * ratio)
        ends = {card.population.has_data_at({"age": value + step, "weight": weight}) for step in (-4, 4)}
        inked = [image.pixelColor(x + i, middle + j) == QColor(LIGHT.line) for i in (0, 1) for j in (-1, 0)]
        if len(ends) == 1:
            assert all(inked) == ends.pop(), value


def test_the_slider_says_where_there_are_data(panel, card):
    panel.show_values(with_values(opened(ExplorerState(), card), (("weight", 95.0),)))
    assert "No data anywhere along" in panel.rows["age"].slider.toolTip()
    panel.show_values(opened(ExplorerState(), card))
    ((low, high),) = card.population.stretches_with_data("age", {})
    assert f"{low:.0f} to {high:.0f} months" in panel.rows["age"].slider.toolTip()


def test_the_edge_follows_the_covariates_that_are_not_on_the_axes(panel, card, qtbot):
    state = replace(opened(ExplorerState(), card), support=Support("age", "sex"))
    panel.show_values(state)
    pause(0.05)  # the axes take their room
    before = panel.support.chart.grab().toImage()
    panel.show_values(with_values(state, (("weight", 60.0),)))
    qtbot.waitUntil(lambda: panel.support.chart.grab().toImage() != before)
    nobody = with_values(state, (("weight", 95.0),))
    panel.show_values(replace(nobody, support=Support("sex", "age")))  # without an edge
    panel.support.chart.grab()
    panel.show_values(state)
    qtbot.waitUntil(lambda: panel.support.chart.grab().toImage() == before)


def test_a_patient_is_told_from_others_by_colour(panel, card, qtbot):
    """As in the list of the patients."""
    state = opened(ExplorerState(), card)
    corners = np.zeros((3, 3), np.float32)
    scan = Scan(corners, corners, np.zeros((0, 3), np.int64), "p.stl")
    places = {1: (60.0, 15.0), 2: (190.0, 50.0)}
    for key, (age, weight) in places.items():
        known = (("age", age), ("weight", weight))
        state = with_patient(state, OpenScan(key, f"{key}.stl", Reading(Path("p.stl")), scan, known))
    panel.show_values(replace(state, patient=None, values=card.start))
    chart = panel.support.chart
    image = chart.grab().toImage()
    ratio = image.devicePixelRatio()
    for key, place in places.items():
        middle = (chart.place_of(*place) * ratio).toPoint()
        assert image.pixelColor(middle) == QColor(patient_colour(key))
