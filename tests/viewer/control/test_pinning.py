"""Places pinned with the mouse, in the window of an atlas that was really trained."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QColor
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel

from naisr_viewer.engine.engine import Engine
from naisr_viewer.panels.kinds import visible_panels
from naisr_viewer.program.headless import finish, pause
from naisr_viewer.state.drawer import Tab
from naisr_viewer.state.layouts import Layout
from naisr_viewer.views.colours import pin_colour
from naisr_viewer.views.ledger import EntryChart
from naisr_viewer.views.shapes.canvas import Canvas

PATIENCE_MS = 20_000


@pytest.fixture
def ready(whole_window, egg_atlas, egg_cache):
    window, controller = whole_window(Engine(folder=egg_cache))
    controller.open(egg_atlas)
    finish(window, controller)
    return window, controller


def middle(canvas: Canvas, cell: int, cells: int) -> QPoint:
    """The middle of a sub-plot, where the shape is."""
    return QPoint(round((cell + 0.5) * canvas.width() / cells), canvas.height() // 2)


def dots(canvas: Canvas, number: int, cells: int) -> list[int]:
    """How many pixels of each sub-plot have the colour of a pin."""
    image = canvas.grab().toImage()
    wanted, ratio = QColor(pin_colour(number)), image.width() / cells
    counts = [0] * cells
    for y in range(0, image.height(), 2):
        for x in range(0, image.width(), 2):
            seen = image.pixelColor(x, y)
            away = abs(seen.red() - wanted.red()) + abs(seen.green() - wanted.green())
            counts[min(int(x / ratio), cells - 1)] += away + abs(seen.blue() - wanted.blue()) < 24
    return counts


def listening(window, qtbot) -> None:
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)  # only then it hears keys


def told(window) -> dict[str, str]:
    """The lines of the places that are told of, by the first."""
    charts = [chart for chart in window.findChildren(EntryChart) if chart.isVisible()]
    return {text.splitlines()[0]: text for text in (chart.accessibleName() for chart in charts)}


def test_a_click_pins_a_place_in_every_shape_and_escape_takes_it_away(ready, qtbot):
    window, controller = ready
    canvas, cells = window.findChild(Canvas), len(visible_panels(controller.state))
    assert not told(window) and controller.state.drawer is None
    QTest.mouseClick(canvas, Qt.MouseButton.LeftButton, pos=middle(canvas, cells - 1, cells))
    qtbot.waitUntil(lambda: "Place 1" in told(window), timeout=PATIENCE_MS)
    assert "Age:" in told(window)["Place 1"] and "Together:" in told(window)["Place 1"]
    qtbot.waitUntil(lambda: all(dots(canvas, 1, cells)), timeout=PATIENCE_MS)
    before = told(window)["Place 1"]
    window.covariates.value_moved.emit("age", 8.5)
    qtbot.waitUntil(lambda: told(window)["Place 1"] != before, timeout=PATIENCE_MS)
    window.covariates.value_settled.emit("age", 8.5)
    finish(window, controller)
    listening(window, qtbot)
    QTest.keyClick(window, Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: not any(dots(canvas, 1, cells)), timeout=PATIENCE_MS)
    assert not told(window) and controller.state.pins == () and controller.state.drawer is None
    QTest.keyClick(window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    qtbot.waitUntil(lambda: all(dots(canvas, 1, cells)), timeout=PATIENCE_MS)


def test_a_cross_takes_one_place_away(ready, qtbot):
    window, controller = ready
    canvas, cells = window.findChild(Canvas), len(visible_panels(controller.state))
    place = middle(canvas, cells - 1, cells)
    for up in (0, 20):
        QTest.mouseClick(canvas, Qt.MouseButton.LeftButton, pos=place - QPoint(0, up))
        pause(0.5)  # else it is a double click
    qtbot.waitUntil(lambda: set(told(window)) == {"Place 1", "Place 2"}, timeout=PATIENCE_MS)
    first = next(
        chart for chart in window.findChildren(EntryChart) if chart.remove.toolTip() == "Remove place 1"
    )
    QTest.mouseClick(first.remove, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: set(told(window)) == {"Place 2"}, timeout=PATIENCE_MS)
    assert [pin.number for pin in controller.state.pins] == [2]
    qtbot.waitUntil(lambda: not any(dots(canvas, 1, cells)), timeout=PATIENCE_MS)


def test_turning_the_shapes_and_clicking_beside_them_pins_nothing(ready, qtbot):
    window, controller = ready
    canvas, cells = window.findChild(Canvas), len(visible_panels(controller.state))
    start = middle(canvas, 0, cells)
    QTest.mousePress(canvas, Qt.MouseButton.LeftButton, pos=start)
    QTest.mouseMove(canvas, start + QPoint(30, 0))
    QTest.mouseRelease(canvas, Qt.MouseButton.LeftButton, pos=start + QPoint(30, 0))
    QTest.mouseClick(canvas, Qt.MouseButton.LeftButton, pos=QPoint(4, 4))
    QTest.mouseClick(canvas, Qt.MouseButton.RightButton, pos=start)
    qtbot.wait(300)
    assert controller.state.pins == ()


def test_pins_stay_at_their_material_points_in_another_layout(ready, qtbot):
    window, controller = ready
    canvas, cells = window.findChild(Canvas), len(visible_panels(controller.state))
    QTest.mouseClick(canvas, Qt.MouseButton.LeftButton, pos=middle(canvas, 1, cells))
    qtbot.waitUntil(lambda: "Place 1" in told(window), timeout=PATIENCE_MS)
    window.layout_requested.emit(Layout.FULL_SHAPE)
    finish(window, controller)
    qtbot.waitUntil(lambda: all(dots(canvas, 1, 1)), timeout=PATIENCE_MS)


def test_the_drawer_opens_and_closes_by_its_tab_and_by_keys(ready, qtbot):
    window, controller = ready
    keys = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.ShiftModifier
    listening(window, qtbot)
    QTest.keyClick(window, Qt.Key.Key_P, keys)
    assert controller.state.drawer is Tab.POINT
    assert "Click on a shape to pin a place" in visible_text(window)
    QTest.keyClick(window, Qt.Key.Key_P, keys)
    assert controller.state.drawer is None
    assert "Click on a shape to pin a place" not in visible_text(window)


def visible_text(window) -> str:
    return "\n".join(label.text() for label in window.findChildren(QLabel) if label.isVisible())
