"""The same window without a person or a display: screenshots and the demonstration."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QCoreApplication, QEvent, QEventLoop, Qt
from PySide6.QtTest import QTest

from naisr_model.errors import InputError
from naisr_viewer.control.controller import Controller
from naisr_viewer.files.exports import planned
from naisr_viewer.panels.kinds import layouts_of, panels_in
from naisr_viewer.state.layouts import FULL_SHAPE, Layout
from naisr_viewer.state.requests import EXACT_RESOLUTION, ExportChoice
from naisr_viewer.views.covariates.row import CovariateRow
from naisr_viewer.views.covariates.slider import SLIDER_STEPS
from naisr_viewer.views.main_window import MainWindow
from naisr_viewer.words.names import STRANGE

DEADLINE_S = 600.0
"""Nothing on screen takes longer than this, even on a slow machine."""

DRAG_STEPS = 24
FRAME_S = 0.03
LEAST_TURNS = 5


def wait_until(condition: Callable[[], bool], seconds: float = DEADLINE_S) -> None:
    """Run the window until ``condition`` holds.

    Raises:
        InputError: when it does not within ``seconds``.
    """
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise InputError(f"gave up after {seconds:g} s; the machine is too slow or the atlas too large")
        QCoreApplication.processEvents(QEventLoop.ProcessEventsFlag.AllEvents, 20)
        QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)  # which that leaves out
        time.sleep(0.002)


def pause(seconds: float) -> None:
    """Let the window and the worker go on; ``QTest.qWait`` would keep Python from the worker.

    A machine that is too busy to come to it gets some turns all the same, in which what is due is painted.
    """
    end, turns = time.monotonic() + seconds, itertools.count()
    wait_until(lambda: next(turns) >= LEAST_TURNS and time.monotonic() > end)


def finish(window: MainWindow, controller: Controller) -> None:
    """Wait until the window is exact.

    Raises:
        InputError: when the window reports an error instead.
    """
    wait_until(lambda: window.shapes.is_ready and not controller.is_busy)
    _require_no_error(window)


def take_screenshot(window: MainWindow, controller: Controller, path: Path) -> None:
    """Write a picture of the window once everything on it is exact, and say so.

    Raises:
        InputError: when the window reports an error instead.
    """
    _picture(window, controller, path)
    print(f"wrote {path}")


def drag(row: CovariateRow, start: float, end: float) -> None:
    """Drag a slider between two shares of its range with the mouse, letting the window follow."""
    slider, left = row.slider, Qt.MouseButton.LeftButton
    QTest.mousePress(slider, left, pos=slider.place_of(start))
    for step in range(1, DRAG_STEPS + 1):
        QTest.mouseMove(slider, slider.place_of(start + (end - start) * step / DRAG_STEPS))
        pause(FRAME_S)
    QTest.mouseRelease(slider, left, pos=slider.place_of(end))


def run_demo(window: MainWindow, controller: Controller, folder: Path) -> None:
    """Drag every slider from end to end with real mouse events; leave pictures and meshes behind.

    At last a full shape that was exported is opened as if it were a patient's, fitted and moved. What the
    atlas cannot do, or has no slider for, is left out.

    Raises:
        InputError: when the window reports an error.
    """
    _picture(window, controller, folder / "start.png")
    for name, row in window.covariates.rows.items():
        plain = STRANGE.sub("-", name).strip("-.")
        drag(row, 0.5, 1.0)
        _picture(window, controller, folder / f"{plain}-high.png")
        drag(row, 1.0, 0.0)
        _picture(window, controller, folder / f"{plain}-low.png")
        row.reset.click()
        print(f"dragged {name} from {row.reach}", flush=True)
    scan = _export_moved(window, controller, folder)
    _fit_and_move(window, controller, folder, scan)
    print(f"wrote pictures and meshes into {folder.absolute()}")


def _picture(window: MainWindow, controller: Controller, path: Path) -> None:
    finish(window, controller)
    controller.save_screenshot(path, replaces=True)
    _require_no_error(window)


def _require_no_error(window: MainWindow) -> None:
    if window.error_text.text():
        raise InputError(window.error_text.text())


def _export_moved(window: MainWindow, controller: Controller, folder: Path) -> Path:
    """Export everything with the first covariate off its centre; returns the file of the full shape."""
    atlas, rows = controller.state.atlas, list(window.covariates.rows.values())
    assert atlas is not None
    controller.set_layout(Layout.FULL_SHAPE)
    for row in rows[:1]:
        drag(row, 0.5, 0.75)
    _picture(window, controller, folder / "full-shape.png")
    ending = "csv" if atlas.is_flat else "stl"
    choice = ExportChoice(panels_in(Layout.SIDE_BY_SIDE, atlas), ending, EXACT_RESOLUTION, folder)
    plan = planned(controller.state, choice)
    controller.export(choice, replaces=True)
    finish(window, controller)
    for row in rows[:1]:
        row.reset.click()
    return next(each.path for each in plan if each.request.panel == FULL_SHAPE)


def _fit_and_move(window: MainWindow, controller: Controller, folder: Path, scan: Path) -> None:
    atlas = controller.state.atlas
    assert atlas is not None
    window.scan_requested.emit(scan)
    finish(window, controller)
    window.patients.known.fit.click()
    _picture(window, controller, folder / "patient-fit.png")
    print("fitted the exported full shape")
    rows = list(window.covariates.rows.items())
    if rows and Layout.CHANGE in layouts_of(atlas):
        controller.set_layout(Layout.CHANGE)
        name, row = rows[0]
        drag(row, row.slider.sliderPosition() / SLIDER_STEPS, 0.25)
        _picture(window, controller, folder / "patient-before-and-after.png")
        print(f"moved it along {name}")
