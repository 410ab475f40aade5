"""Maps in the window: chosen with the mouse, their scale dragged and fitted, undisturbed by undo."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest

from naisr_viewer.program.headless import finish
from naisr_viewer.state.layouts import FULL_SHAPE, Panel
from naisr_viewer.state.overlay import Quantity
from naisr_viewer.views.map_bar import MapBar
from naisr_viewer.views.shapes.colour_bar import ColourBar

AGE = Panel("effect", "age")


@pytest.fixture
def ready(open_window, atlas_file):
    window, controller = open_window((1280, 800))
    controller.open(atlas_file)
    finish(window, controller)
    window.covariates.value_settled.emit("age", 180.0)
    finish(window, controller)
    return window, controller


def press(window, quantity: Quantity) -> None:
    (bar,) = window.findChildren(MapBar)
    QTest.mouseClick(bar.buttons[quantity], Qt.MouseButton.LeftButton)


def bars(window) -> list[ColourBar]:
    found = [bar for bar in window.findChildren(ColourBar) if bar.isVisible()]
    return sorted(found, key=lambda bar: bar.mapTo(window, QPoint(0, 0)).x())


def test_colours_come_and_go_with_a_click(ready, atlas):
    window, controller = ready
    assert bars(window) == [] and controller.shown[AGE].colouring is None
    press(window, Quantity.DISPLACEMENT)
    finish(window, controller)
    assert len(bars(window)) == 4  # three effects and the full shape
    shape = controller.shown[AGE]
    np.testing.assert_allclose(
        shape.colouring.values, atlas.moved_mm(shape.points_mm, {"age": 180.0}), atol=1e-3
    )
    press(window, Quantity.PLAIN)
    finish(window, controller)
    assert bars(window) == [] and controller.shown[AGE].colouring is None


def test_an_end_of_the_scale_is_dragged_for_all_and_fitted_by_a_double_click(ready):
    window, controller = ready
    press(window, Quantity.DISPLACEMENT)
    finish(window, controller)
    first, *others = bars(window)
    before = first.limit or 0.0
    end = first.band.bottomRight().toPoint() - QPoint(1, 3)
    middle = first.band.center().toPoint()
    QTest.mousePress(first, Qt.MouseButton.LeftButton, pos=end)
    QTest.mouseMove(first, (end + middle) / 2)
    QTest.mouseRelease(first, Qt.MouseButton.LeftButton, pos=(end + middle) / 2)
    assert first.limit == pytest.approx(2 * before, rel=0.1)
    assert {bar.limit for bar in others} == {first.limit}
    QTest.mouseDClick(first, Qt.MouseButton.LeftButton, pos=middle)
    most = max(float(np.abs(each.colouring.values).max()) for each in with_colours(controller))
    assert most <= (first.limit or 0.0) <= 1.1 * most


def with_colours(controller):
    return [each for each in controller.shown.values() if each.colouring is not None]


def test_the_colours_follow_the_hand_and_are_no_step_to_undo(ready):
    window, controller = ready
    press(window, Quantity.DISPLACEMENT)
    finish(window, controller)
    window.covariates.value_moved.emit("age", 60.0)
    finish(window, controller)
    on_the_way = controller.shown[FULL_SHAPE].colouring.values
    assert on_the_way.min() < -1.0  # shorter than the template now
    window.covariates.value_settled.emit("age", 60.0)
    finish(window, controller)
    window.undo_requested.emit()
    finish(window, controller)
    assert dict(controller.state.named)["age"] == 180.0
    assert controller.state.overlay.quantity is Quantity.DISPLACEMENT


def test_rates_are_of_what_was_moved_last(ready):
    window, controller = ready
    press(window, Quantity.RATE)
    finish(window, controller)
    assert "Full shape: Age, mm per month" in words(window)
    window.covariates.value_settled.emit("sex", 1.0)
    finish(window, controller)
    assert "Full shape: Sex, mm, M against F" in words(window)
    assert controller.shown[FULL_SHAPE].request.map.covariate == "sex"


def words(window) -> str:
    (bar,) = window.findChildren(MapBar)
    return "\n".join(each.text() for each in bar.children() if hasattr(each, "text"))


def test_what_is_muted_moves_the_full_shape_no_more(ready, atlas):
    window, controller = ready
    rows = window.covariates.rows
    window.covariates.value_settled.emit("weight", 60.0)
    finish(window, controller)
    assert volume(controller) == pytest.approx(atlas.volume_cm3(age=180.0, weight=60.0), rel=0.01)
    QTest.mouseClick(rows["weight"].mute, Qt.MouseButton.LeftButton)
    finish(window, controller)
    assert volume(controller) == pytest.approx(atlas.volume_cm3(age=180.0), rel=0.01)
    assert "without Weight" in window.shapes.caption(FULL_SHAPE)
    assert dict(controller.state.named)["weight"] == 60.0  # the slider stays where it is
    QTest.mouseClick(rows["weight"].solo, Qt.MouseButton.LeftButton)
    finish(window, controller)
    assert volume(controller) == pytest.approx(atlas.volume_cm3(weight=60.0), rel=0.01)
    assert "without Age and Sex" in window.shapes.caption(FULL_SHAPE)
    assert rows["age"].mute.isChecked() and not rows["weight"].mute.isChecked()
    QTest.mouseClick(rows["weight"].solo, Qt.MouseButton.LeftButton)
    finish(window, controller)
    assert "without" not in window.shapes.caption(FULL_SHAPE)


def volume(controller) -> float:
    return float(controller.shown[FULL_SHAPE].extent)
