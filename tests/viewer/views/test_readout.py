"""What is under a resting mouse stands in the status line, and goes when that holds no more."""

from __future__ import annotations

import re

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest

from naisr_viewer.program.headless import finish, pause
from naisr_viewer.state.layouts import FULL_SHAPE, Layout
from naisr_viewer.state.overlay import Quantity
from naisr_viewer.views.status_bar import StatusBar
from naisr_viewer.words.readout import number, readout

NUMBERS = re.compile(r"[+−]?\d+\.\d+")


@pytest.fixture
def ready(open_window, atlas_file):
    window, controller = open_window((1280, 800))
    controller.open(atlas_file)
    finish(window, controller)
    window.layout_requested.emit(Layout.FULL_SHAPE)
    window.covariates.value_settled.emit("age", 180.0)
    finish(window, controller)
    return window, controller


def rest(window, place: QPoint) -> None:
    QTest.mouseMove(window.shapes.canvas, place + QPoint(2, 0))
    QTest.mouseMove(window.shapes.canvas, place)


def told(window) -> str:
    (bar,) = window.findChildren(StatusBar)
    return bar.readout.text()


def test_the_place_and_the_number_under_the_mouse_are_told(ready, qtbot, atlas):
    window, controller = ready
    window.quantity_chosen.emit(Quantity.DISPLACEMENT)
    finish(window, controller)
    middle = window.shapes.canvas.rect().center() - QPoint(0, 20)
    rest(window, middle)
    qtbot.waitUntil(lambda: told(window) != "")
    found = [float(each.replace("−", "-")) for each in NUMBERS.findall(told(window))]
    assert told(window).startswith("Full shape: ") and " mm at " in told(window) and len(found) == 4
    value, point = found[0], np.array(found[1:])
    axes = atlas.half_axes_mm(**dict(controller.state.named))
    assert np.sum((point / axes) ** 2) == pytest.approx(1.0, abs=0.03)
    shape = controller.shown[FULL_SHAPE]
    nearest = np.linalg.norm(shape.points_mm - point, axis=1).argmin()
    assert value == pytest.approx(shape.colouring.values[nearest], abs=0.3)
    QTest.mouseMove(window.shapes.canvas, QPoint(3, 3))  # beside the shape
    qtbot.waitUntil(lambda: told(window) == "")


def test_nothing_is_told_while_something_moves(ready, qtbot):
    window, controller = ready
    middle = window.shapes.canvas.rect().center()
    QTest.mousePress(window.shapes.canvas, Qt.MouseButton.LeftButton, pos=middle)
    for step in range(5):
        QTest.mouseMove(window.shapes.canvas, middle + QPoint(step, 0))
    pause(0.2)
    assert told(window) == ""
    QTest.mouseRelease(window.shapes.canvas, Qt.MouseButton.LeftButton, pos=middle)
    rest(window, middle)
    qtbot.waitUntil(lambda: told(window) != "")
    window.covariates.value_moved.emit("age", 60.0)
    qtbot.waitUntil(lambda: told(window) == "")
    finish(window, controller)


def test_numbers_have_digits_that_mean_something():
    assert number(1.3149, "mm", True) == "+1.31 mm"
    assert number(-0.0042, "mm per kg", True) == "-0.0042 mm per kg"
    assert number(0.0, "mm", False) == "0.00 mm"
    assert readout("Age only", (12.34, -4.0, 5.06), number(-1.2, "mm", True)) == (
        "Age only: −1.20 mm at 12.3, −4.0, 5.1 mm"
    )
    assert readout("Full-shape", (1, 2, 3)) == "Full-shape: 1.0, 2.0, 3.0 mm"
