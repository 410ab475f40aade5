"""The curve in the drawer and the patient among people, in the window of an atlas that was really trained."""

from __future__ import annotations

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from eggs import egg
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QPushButton

from naisr_viewer.engine.engine import Engine
from naisr_viewer.program.headless import finish
from naisr_viewer.state.drawer import Tab
from naisr_viewer.state.layouts import Panel
from naisr_viewer.state.patients import Reading
from naisr_viewer.views.charts.curves import CurveChart
from naisr_viewer.views.curve_page import CurvePage

PATIENCE_MS = 30_000
CTRL_SHIFT = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.ShiftModifier
LEFT = Qt.MouseButton.LeftButton


@pytest.fixture
def ready(whole_window, egg_atlas, egg_cache):
    window, controller = whole_window(Engine(folder=egg_cache))
    controller.open(egg_atlas)
    finish(window, controller)
    return window, controller


def text(window) -> str:
    return "\n".join(label.text() for label in window.findChildren(QLabel) if label.isVisible())


def open_curve(window, controller, qtbot) -> CurveChart:
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    QTest.keyClick(window, Qt.Key.Key_C, CTRL_SHIFT)
    assert controller.state.drawer is Tab.CURVE
    qtbot.waitUntil(
        lambda: "95 % of people:" in text(window) and "done" not in text(window), timeout=PATIENCE_MS
    )
    finish(window, controller)
    return window.findChild(CurveChart)


def test_dragging_the_line_is_dragging_the_slider(ready, qtbot):
    window, controller = ready
    chart = open_curve(window, controller, qtbot)
    before, told = controller.state.values, text(window)
    start = QPoint(round(chart.place_of(before[0]).x()), chart.height() // 2)
    goal = QPoint(round(chart.place_of(8.0).x()), start.y())
    QTest.mousePress(chart.viewport(), LEFT, pos=start)
    for x in np.linspace(start.x(), goal.x(), 4)[1:]:
        QTest.mouseMove(chart.viewport(), QPoint(round(x), start.y()))
        assert controller.is_moving
    QTest.mouseRelease(chart.viewport(), LEFT, pos=goal)
    assert not controller.is_moving
    assert controller.state.values[0] == pytest.approx(8.0, abs=0.1)
    assert window.covariates.rows["age"].box.value == controller.state.values[0]
    assert text(window) != told  # at another place along the same curve
    finish(window, controller)
    QTest.keyClick(window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert controller.state.values == before  # one step


def test_who_begins_anew_with_an_atlas_learns_at_once_what_is_usual(ready, qtbot):
    window, controller = ready
    open_curve(window, controller, qtbot)
    controller.begin(replace(controller.state, has_norms=False))
    finish(window, controller)
    assert controller.state.has_norms and "95 % of people:" in text(window)


def test_another_measure_along_another_covariate(ready, qtbot):
    window, controller = ready
    open_curve(window, controller, qtbot)
    page = window.findChild(CurvePage)
    page.measure.setFocus()
    QTest.keyClick(page.measure, Qt.Key.Key_Down)
    page.measure.activated.emit(page.measure.currentIndex())
    assert controller.state.curve.measure == "area" and "cm²" in text(window)
    page.along.setCurrentIndex(2)
    page.along.activated.emit(2)
    finish(window, controller)
    assert controller.state.curve.covariate == "sex" and "Sex" in text(window)


def test_a_curve_is_written_with_what_it_is(ready, qtbot, tmp_path):
    window, controller = ready
    open_curve(window, controller, qtbot)
    for ending in ("csv", "svg"):
        window.curve_place_chosen.emit(tmp_path / f"curve.{ending}")
    with (tmp_path / "curve.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["series", "age [years]", "volume [cm³]", "low [cm³]", "high [cm³]"]
    people = [row for row in rows if row["series"] == "training"]
    mean = [row for row in rows if row["series"] == "population"]
    assert len(people) == 19 and float(mean[0]["low [cm³]"]) < float(mean[0]["volume [cm³]"])
    record = json.loads((tmp_path / "curve.csv.json").read_text(encoding="utf-8"))
    assert (record["measure"], record["along"], record["unit"]) == ("volume", "age", "cm³")
    assert record["patient"] is None and record["other_covariates"].keys() == {"sex"}
    assert b"<svg" in (tmp_path / "curve.svg").read_bytes()
    (tmp_path / "curve.csv").write_bytes(b"mine")
    window.curve_place_chosen.emit(tmp_path / "curve.csv")
    assert (tmp_path / "curve.csv").read_bytes() == b"mine" and "there already" in window.error_text.text()


def test_what_is_usual_is_stopped_and_begun_by_hand(whole_window, egg_atlas, tmp_path, qtbot):
    window, controller = whole_window(Engine(folder=tmp_path / "cache"))
    controller.open(egg_atlas)
    finish(window, controller)
    window.drawer_requested.emit(Tab.CURVE)
    page = window.findChild(CurvePage)
    qtbot.waitUntil(lambda: page.begin.text() == "Cancel" and page.begin.isVisible(), timeout=PATIENCE_MS)
    QTest.mouseClick(page.begin, LEFT)
    finish(window, controller)
    assert not controller.state.has_norms and "not worked out" in text(window)
    QTest.mouseClick(page.begin, LEFT)
    finish(window, controller)
    assert controller.state.has_norms and not page.begin.isVisible()


def test_a_fitted_patient_is_told_among_people(ready, tmp_path, qtbot):
    window, controller = ready
    file = tmp_path / "p.stl"
    egg(6.0, 1.0).export(file)
    window.reading_requested.emit(Reading(file))
    finish(window, controller)
    window.patients.known.give((("age", 6.0), ("sex", 1.0)))
    QTest.mouseClick(next(b for b in window.patients.findChildren(QPushButton) if b.text() == "Fit"), LEFT)
    qtbot.waitUntil(lambda: "percentile (z" in text(window), timeout=PATIENCE_MS)
    finish(window, controller)
    assert np.isfinite(controller.shown[Panel("unusual")].colouring.values).all()
    window.patients.close_requested.emit(1)
    finish(window, controller)
    assert "percentile (z" not in text(window)
