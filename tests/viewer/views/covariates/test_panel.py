"""Sliders, numbers and buttons, alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QColor
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QScrollArea
from pytestqt.qtbot import QtBot

from naisr_viewer.program.headless import pause
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.explorer import ExplorerState, opened, with_patient, with_value
from naisr_viewer.state.patients import Fitted, OpenScan, Reading, Scan
from naisr_viewer.views.colours import covariate_colour
from naisr_viewer.views.covariates import panel as cp
from naisr_viewer.views.covariates.histogram import BAND_PX, Histogram
from naisr_viewer.views.covariates.row import SETTLE_MS
from naisr_viewer.views.covariates.slider import (
    HANDLE_PX,
    SLIDER_STEPS,
    JumpSlider,
    slider_position,
)
from naisr_viewer.views.theme import DARK, LIGHT, palette


@pytest.fixture
def panel(qtbot: QtBot, card) -> cp.CovariatePanel:
    panel = cp.CovariatePanel()
    qtbot.addWidget(panel)
    panel.show_atlas(card, LIGHT)
    panel.show_values(opened(ExplorerState(), card))
    panel.resize(cp.PANEL_WIDTH, 700)
    with qtbot.waitExposed(panel):
        panel.show()
    return panel


@pytest.fixture
def heard(panel) -> list[tuple[str, str, float]]:
    acts: list[tuple[str, str, float]] = []
    panel.value_moved.connect(lambda name, value: acts.append(("moved", name, value)))
    panel.value_settled.connect(lambda name, value: acts.append(("settled", name, value)))
    return acts


def at(slider: JumpSlider, share: float) -> QPoint:
    x = HANDLE_PX / 2 + share * (slider.width() - HANDLE_PX)
    return QPoint(round(x), slider.height() // 2)


def test_showing_a_value_says_nothing(panel, heard, card):
    state = with_value(opened(ExplorerState(), card), "age", 180)
    panel.show_values(with_value(state, "sex", 1))
    assert panel.rows["age"].box.value == 180
    assert panel.rows["age"].slider.value() == slider_position(card.covariates[0], 180)
    assert [button.isChecked() for button in panel.rows["sex"].buttons] == [False, True]
    assert heard == []


def test_a_drag_moves_on_the_way_and_settles_on_release(panel, heard):
    slider = panel.rows["age"].slider
    QTest.mousePress(slider, Qt.MouseButton.LeftButton, pos=at(slider, 0.5))
    for share in (0.6, 0.7, 0.8):
        QTest.mouseMove(slider, at(slider, share))
    assert {kind for kind, _, _ in heard} == {"moved"}
    QTest.mouseRelease(slider, Qt.MouseButton.LeftButton, pos=at(slider, 0.8))
    assert [kind for kind, _, _ in heard].count("settled") == 1
    kind, name, value = heard[-1]
    assert (kind, name) == ("settled", "age")
    assert value == pytest.approx(1 + 0.8 * 219, abs=2)
    pause(2 * SETTLE_MS / 1000)
    assert heard[-1] == (kind, name, value)


def test_a_click_brings_the_handle_there(panel, heard):
    slider = panel.rows["weight"].slider
    QTest.mouseClick(slider, Qt.MouseButton.LeftButton, pos=at(slider, 0.25))
    assert heard[-1][:2] == ("settled", "weight")
    assert heard[-1][2] == pytest.approx(4 + 0.25 * 91, abs=1)
    assert slider.sliderPosition() == pytest.approx(0.25 * SLIDER_STEPS, abs=5)


def test_other_buttons_do_nothing(panel, heard):
    slider = panel.rows["weight"].slider
    QTest.mouseClick(slider, Qt.MouseButton.RightButton, pos=at(slider, 0.25))
    assert heard == []


def test_several_keys_are_one_change(panel, heard, qtbot):
    slider = panel.rows["age"].slider
    slider.setFocus()
    for _ in range(3):
        QTest.keyClick(slider, Qt.Key.Key_Right)
    assert [kind for kind, _, _ in heard] == ["moved"] * 3
    qtbot.waitUntil(lambda: heard[-1][0] == "settled", timeout=30_000)
    assert heard[-1][2] == heard[2][2]


def test_the_wheel_scrolls_and_changes_nothing(panel, heard):
    panel.resize(cp.PANEL_WIDTH, 200)
    panel.rows["age"].slider.setFocus()
    area = panel.findChild(QScrollArea)
    place = panel.rows["age"].slider.mapTo(panel, panel.rows["age"].slider.rect().center())
    QTest.wheelEvent(panel.windowHandle(), QPointF(place), QPoint(0, -120))
    pause(0.02)
    assert heard == [] and area.verticalScrollBar().value() > 0


def test_values_are_as_round_as_they_are_shown(panel, heard):
    for name, step in (("age", 1.0), ("weight", 0.1)):
        slider = panel.rows[name].slider
        for share in (0.137, 0.503, 0.911):
            QTest.mouseClick(slider, Qt.MouseButton.LeftButton, pos=at(slider, share))
            value = heard[-1][2]
            assert value == pytest.approx(step * round(value / step), abs=1e-9)
            assert float(panel.rows[name].covariate.format(value).split()[0]) == pytest.approx(value)
        QTest.mouseClick(slider, Qt.MouseButton.LeftButton, pos=at(slider, 1.0))
        assert heard[-1][2] == panel.rows[name].covariate.range[1]


def test_a_typed_number_is_taken_exactly(panel, heard, qtbot):
    box = panel.rows["weight"].box
    box.selectAll()
    QTest.keyClicks(box, "42.5")
    assert heard == []  # not before it is finished
    QTest.keyClick(box, Qt.Key.Key_Return)
    qtbot.waitUntil(lambda: ("settled", "weight", 42.5) in heard, timeout=30_000)


def test_a_binary_covariate_is_chosen_or_dragged_between(panel, heard):
    row = panel.rows["sex"]
    QTest.mouseClick(row.buttons[1], Qt.MouseButton.LeftButton)
    assert heard[-1] == ("settled", "sex", 1.0)
    QTest.mouseClick(row.slider, Qt.MouseButton.LeftButton, pos=at(row.slider, 0.25))
    assert heard[-1][2] == pytest.approx(-0.5, abs=0.02)
    row.set_value(-0.5)
    assert "between F and M" in row.reading.text()
    row.set_value(-1.0)
    assert row.reading.text() == "F"


def test_resets_are_asked_for(panel, qtbot):
    panel.rows["age"].set_value(50)
    with qtbot.waitSignal(panel.reset_requested) as asked:
        QTest.mouseClick(panel.rows["age"].reset, Qt.MouseButton.LeftButton)
    assert asked.args == ["age"]
    assert not panel.rows["weight"].reset.isEnabled()  # it is at the mean already
    with qtbot.waitSignal(panel.reset_all_requested):
        QTest.mouseClick(panel.reset_all, Qt.MouseButton.LeftButton)


def test_units_and_colours_are_on_every_row(panel, card):
    for covariate in card.covariates:
        row = panel.rows[covariate.name]
        texts = [child.text() for child in row.findChildren(QLabel)]
        assert covariate.name.capitalize() in texts
        assert covariate.unit in texts
        assert covariate_colour(card, covariate.name) in row.slider.styleSheet()
    panel.set_theme(DARK)
    assert DARK.raised in panel.rows["age"].slider.styleSheet()


def test_another_atlas_replaces_the_rows(panel, card, qtbot):
    old = panel.rows["age"]
    panel.show_atlas(card, LIGHT)
    assert panel.rows["age"] is not old and not old.isVisible()  # at once, not with the next event
    assert list(panel.rows) == ["age", "weight", "sex"]


def with_fit(card: AtlasCard) -> ExplorerState:
    """A girl whose age and sex are known and whose weight was inferred."""
    values = (("age", 84.0), ("weight", 21.34), ("sex", -1.0))
    fit = Fitted(1, values, (("weight", 18.2, 34.9),), 48.0, 3.0, residual_mm=0.4, lasting=0.4, seconds=2.0)
    points_mm, faces = np.zeros((3, 3), np.float32), np.zeros((0, 3), np.int64)
    scan = Scan(points_mm, points_mm, faces, "p01.stl")
    patient = OpenScan(1, "p01.stl", Reading(Path("p01.stl")), scan, (("age", 84.0), ("sex", -1.0)), fit)
    return with_patient(opened(ExplorerState(), card), patient)


def inked(histogram: Histogram, colour: str) -> np.ndarray:
    """Columns and rows of the pixels in this colour, ``[n, 2]``."""
    image, wanted = histogram.grab().toImage(), QColor(colour)
    places = [(x, y) for x in range(image.width()) for y in range(image.height())]
    near = [
        (x, y)
        for x, y in places
        if max(
            abs(image.pixelColor(x, y).red() - wanted.red()),
            abs(image.pixelColor(x, y).green() - wanted.green()),
            abs(image.pixelColor(x, y).blue() - wanted.blue()),
        )
        < 20
    ]
    return np.array(near).reshape(-1, 2)


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=["light", "dark"])
def test_the_patient_is_marked_under_the_slider(panel, card, theme):
    panel.setPalette(palette(theme))
    panel.set_theme(theme)
    row = panel.rows["weight"]
    assert len(inked(row.histogram, theme.text)) == 0
    tick = inked(row.histogram, covariate_colour(card, "weight"))
    panel.show_values(with_value(with_fit(card), "weight", 60))
    mark = inked(row.histogram, theme.text)

    def x_of(value: float) -> float:
        share = (value - 4) / 91
        return HANDLE_PX / 2 + share * (row.histogram.width() - HANDLE_PX)

    band = mark[mark[:, 1] >= row.histogram.height() - BAND_PX]
    triangle = mark[mark[:, 1] < row.histogram.height() - BAND_PX]
    assert (band[:, 0].min(), band[:, 0].max()) == pytest.approx((x_of(18.2), x_of(34.9)), abs=1.5)
    assert triangle[:, 0].mean() == pytest.approx(x_of(21.34), abs=1.5)
    assert len(triangle) > 15
    # The mean is still marked, from top to bottom except where the band is.
    still = inked(row.histogram, covariate_colour(card, "weight"))
    assert set(still[:, 0]) == set(tick[:, 0])
    panel.show_values(opened(ExplorerState(), card))
    assert len(inked(row.histogram, theme.text)) == 0


def test_a_known_covariate_has_no_band(panel, card):
    panel.show_values(with_fit(card))
    histogram = panel.rows["age"].histogram
    mark = inked(histogram, LIGHT.text)
    assert len(mark) > 15 and mark[:, 1].max() < histogram.height() - BAND_PX


def test_marks_are_told_apart_on_hover(panel, card):
    panel.show_values(with_fit(card))
    age, weight, sex = (panel.rows[name].histogram.toolTip() for name in ("age", "weight", "sex"))
    assert "Triangle: patient 84 months" in age and "95\u00a0%" not in age
    assert "Tick: population mean 100 months" in age
    assert "Triangle: patient 21.3 kg, 95\u00a0%: 18.2 to 34.9" in weight
    assert "Triangle: patient F" in sex
    panel.show_values(opened(ExplorerState(), card))
    assert "patient" not in panel.rows["age"].histogram.toolTip()
    assert f"{len(card.population.observed('age'))} shapes" in panel.rows["age"].histogram.toolTip()


def test_home_is_the_patient_or_the_population_mean(panel, card):
    row = panel.rows["age"]
    assert row.reset.toolTip() == "Back to the population mean (100 months)"
    assert panel.reset_all.text() == "Reset all"
    state = with_fit(card)
    panel.show_values(state)
    assert row.reset.toolTip() == "Back to the patient (84 months)"
    assert panel.rows["sex"].reset.toolTip() == "Back to the patient (F)"
    assert panel.reset_all.text() == "Back to the patient"
    assert not row.reset.isEnabled()
    panel.show_values(with_value(state, "age", 100))
    assert row.reset.isEnabled() and not panel.rows["weight"].reset.isEnabled()
    panel.show_values(opened(ExplorerState(), card))
    assert not row.reset.isEnabled() and panel.reset_all.text() == "Reset all"


def test_following_is_asked_for_and_shown(panel, card, qtbot):
    heard: list[bool] = []
    panel.follow_toggled.connect(heard.append)
    panel.show_values(replace(opened(ExplorerState(), card), follow=True))
    assert panel.follow.isChecked() and heard == []
    QTest.mouseClick(panel.follow, Qt.MouseButton.LeftButton, pos=QPoint(8, panel.follow.height() // 2))
    assert heard == [False]


def test_following_needs_two_continuous_covariates(panel, card):
    assert panel.follow.isVisible()
    of_one = replace(card, covariates=(card.covariates[0], card.covariates[2]))
    panel.show_atlas(of_one, LIGHT)
    assert not panel.follow.isVisible()
