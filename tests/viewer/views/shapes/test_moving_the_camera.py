"""The camera in the hands of a user: keys, wheel and double click on the shapes of a window."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from naisr_viewer.program.headless import finish, pause
from naisr_viewer.state.layouts import Layout

LEFT = Qt.MouseButton.LeftButton


@pytest.fixture
def ready(open_window, atlas_file):
    window, controller = open_window((1000, 700))
    controller.open(atlas_file)
    finish(window, controller)
    window.layout_requested.emit(Layout.FULL_SHAPE)
    window.shapes.look_from("the front")
    finish(window, controller)
    pause(0.1)
    return window, controller


def press(window, key: Qt.Key, shift: bool = False) -> None:
    modifier = Qt.KeyboardModifier.ShiftModifier if shift else Qt.KeyboardModifier.NoModifier
    QTest.keyClick(window.shapes, key, modifier)


def towards(window) -> np.ndarray:
    camera = window.shapes.camera
    away = np.subtract(camera.position_mm, camera.focus_mm)
    return away / np.linalg.norm(away)


def test_keys_turn_move_and_zoom_and_the_opening_view_comes_back(ready):
    window, _ = ready
    window.shapes.reset_camera()
    opening = window.shapes.camera
    press(window, Qt.Key.Key_Right)
    press(window, Qt.Key.Key_Up)
    assert np.linalg.norm(towards(window) - np.array([0.9, -0.45, 0.15]) / 1.017) > 0.1
    focus = np.array(window.shapes.camera.focus_mm)
    press(window, Qt.Key.Key_Up, shift=True)
    assert np.linalg.norm(window.shapes.camera.focus_mm - focus) > 1
    press(window, Qt.Key.Key_Plus)
    assert window.shapes.camera.zoom < opening.zoom
    press(window, Qt.Key.Key_Minus)
    press(window, Qt.Key.Key_Minus)
    assert window.shapes.camera.zoom > opening.zoom
    window.shapes.reset_camera()
    again = window.shapes.camera
    assert again.position_mm == pytest.approx(opening.position_mm) and again.up == opening.up
    assert again.zoom == pytest.approx(opening.zoom)


def test_shapes_go_where_the_arrow_points(ready):
    """Facing the body, its right is at our left: turned to the right, that side comes in sight."""
    window, _ = ready
    press(window, Qt.Key.Key_Right)
    assert towards(window)[0] < -0.05
    press(window, Qt.Key.Key_Left)
    press(window, Qt.Key.Key_Down)
    assert towards(window)[2] > 0.05


def turn_wheel(window, place: QPoint, notches: int) -> None:
    canvas = window.shapes.canvas
    event = QWheelEvent(
        QPointF(place), QPointF(canvas.mapToGlobal(place)), QPoint(), QPoint(0, 120 * notches),
        Qt.MouseButton.NoButton, Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase, False,
    )  # fmt: skip
    QApplication.sendEvent(canvas, event)


def test_the_wheel_comes_nearer_to_what_is_under_the_pointer(ready, qtbot):
    window, _ = ready
    canvas, found = window.shapes.canvas, []
    window.shapes.clicked.connect(lambda _, point_mm: found.append(point_mm))
    place = canvas.rect().center() + QPoint(20, -90)
    QTest.mouseClick(canvas, LEFT, pos=place)
    qtbot.waitUntil(lambda: len(found) == 1)
    before = window.shapes.camera.zoom
    turn_wheel(window, place, 3)
    assert window.shapes.camera.zoom < 0.8 * before
    pause(0.1)
    QTest.mouseClick(canvas, LEFT, pos=place)
    qtbot.waitUntil(lambda: len(found) == 2)
    assert found[1] == pytest.approx(found[0], abs=0.6)
    turn_wheel(window, place, -3)
    assert window.shapes.camera.zoom == pytest.approx(before)


def test_a_double_click_centres_the_point_and_pins_nothing(ready, qtbot):
    window, _ = ready
    canvas = window.shapes.canvas
    place = canvas.rect().center() + QPoint(20, -90)
    focus = np.array(window.shapes.camera.focus_mm)
    with qtbot.assertNotEmitted(window.shapes.clicked, wait=QApplication.doubleClickInterval() + 100):
        QTest.mouseClick(canvas, LEFT, pos=place)
        QTest.mouseDClick(canvas, LEFT, pos=place)
    moved = window.shapes.camera.focus_mm - focus
    assert moved[2] > 5 and moved[0] > 1  # up, and to the left of the body, which is at our right
