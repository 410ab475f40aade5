"""The whole window on a display, used with mouse and keyboard."""

from __future__ import annotations

import gc
import itertools
import threading
from pathlib import Path

import pytest
from PySide6.QtCore import QMimeData, QPoint, QPointF, Qt, QTimer, QUrl
from PySide6.QtGui import QAction, QDropEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QFileDialog, QMenu, QPushButton, QWidget
from vtkmodules.vtkCommonCore import vtkOutputWindow, vtkStringOutputWindow

from naisr_viewer.program.headless import pause
from naisr_viewer.state.layouts import FULL_SHAPE, Layout, Panel
from naisr_viewer.state.requests import EXACT_RESOLUTION, PREVIEW_RESOLUTION
from naisr_viewer.state.theme import ThemeChoice
from naisr_viewer.views.covariates.slider import HANDLE_PX, JumpSlider
from naisr_viewer.views.dialogs.export import ExportDialog
from naisr_viewer.views.theme import DARK

AGE_ONLY = Panel("effect", "age")


def at(slider: JumpSlider, share: float) -> QPoint:
    return QPoint(round(HANDLE_PX / 2 + share * (slider.width() - HANDLE_PX)), slider.height() // 2)


def press_keys(window: QWidget, keys: str) -> None:
    """Trigger the menu entry that has these keys, as the keyboard would."""
    (action,) = [a for a in window.findChildren(QAction) if a.shortcut().toString() == keys]
    assert action.isEnabled()
    action.trigger()


@pytest.fixture
def ready(open_window, qtbot, atlas_file, atlas):
    window, controller = open_window()
    controller.open(atlas_file)
    qtbot.waitUntil(lambda: not controller.is_busy and bool(controller.shown), timeout=30_000)
    qtbot.waitUntil(lambda: window.shapes.is_ready, timeout=30_000)
    atlas.calls.clear()
    return window, controller


def wait_idle(qtbot, controller) -> None:
    qtbot.waitUntil(lambda: not controller.is_busy, timeout=30_000)


def test_an_empty_window_says_what_to_do(open_window):
    window, _ = open_window()
    texts = [child.text() for child in window.findChildren(QPushButton) if child.isVisible()]
    assert "Open atlas…" in texts
    assert not window.covariates.isVisible()


def test_a_drag_with_the_mouse_ends_exact_and_leaves_no_queue(ready, qtbot, atlas):
    window, controller = ready
    QTest.mouseClick(window.covariates.rows["sex"].buttons[1], Qt.MouseButton.LeftButton)
    wait_idle(qtbot, controller)
    (tracker,) = atlas.trackers
    before = tracker.began
    atlas.calls.clear()
    atlas.preview_gate.clear()  # no preview is finished before the mouse is let go
    slider = window.covariates.rows["age"].slider
    QTest.mousePress(slider, Qt.MouseButton.LeftButton, pos=at(slider, 0.45))
    for step in range(80):
        QTest.mouseMove(slider, at(slider, 0.45 + 0.5 * step / 80))
        QApplication.processEvents()
    qtbot.waitUntil(lambda: tracker.began > before)
    QTest.mouseRelease(slider, Qt.MouseButton.LeftButton, pos=at(slider, 0.95))
    atlas.preview_gate.set()
    wait_idle(qtbot, controller)
    assert tracker.began - before <= 6  # what ran, what waited, and where the mouse was let go
    assert {(what, size) for what, _, size in atlas.calls} == {
        ("age", EXACT_RESOLUTION),
        ("shape", EXACT_RESOLUTION),
    }
    assert len(atlas.calls) == 2
    assert atlas.running == 0
    age = dict(controller.state.named)["age"]
    last = 0.45 + 0.5 * 79 / 80
    assert age == pytest.approx(1 + last * 219, abs=219 / slider.width() + 0.5)  # a pixel, and whole months
    for panel in (AGE_ONLY, FULL_SHAPE):
        assert controller.shown[panel].is_exact
        assert dict(controller.shown[panel].request.values)["age"] == age
    assert controller.shown[FULL_SHAPE].extent == pytest.approx(atlas.volume_cm3(age=age, sex=1.0), rel=0.01)
    assert f"{controller.shown[FULL_SHAPE].extent:.1f} cm³" in window.shapes.caption(FULL_SHAPE)


def test_the_ring_among_the_data_is_dragged_like_both_sliders(ready, qtbot, atlas):
    window, controller = ready
    window.resize(960, 900)
    qtbot.waitUntil(lambda: window.covariates.support.chart is not None)
    chart = window.covariates.support.chart
    qtbot.waitUntil(chart.isVisible)
    wait_idle(qtbot, controller)
    pause(0.05)  # the axes take their room
    start, goal = chart.place_of(100, 35).toPoint(), chart.place_of(180, 62).toPoint()
    QTest.mousePress(chart.viewport(), Qt.MouseButton.LeftButton, pos=start)
    for step in range(1, 11):
        QTest.mouseMove(chart.viewport(), start + (goal - start) * step / 10)
        pause(0.005)
    qtbot.waitUntil(lambda: "Preview" in window.status.text())
    assert controller.is_moving
    QTest.mouseRelease(chart.viewport(), Qt.MouseButton.LeftButton, pos=goal)
    wait_idle(qtbot, controller)
    age, weight, _ = moved = controller.state.values
    assert (age, weight) == pytest.approx((180, 62), abs=2)
    assert (window.covariates.rows["age"].box.value, window.covariates.rows["weight"].box.value) == (
        age,
        weight,
    )
    assert dict(controller.shown[FULL_SHAPE].request.values) == dict(controller.state.named)
    press_keys(window, "Ctrl+Z")
    assert controller.state.values == (100.0, 35.0, 0.0)
    assert not next(a for a in window.findChildren(QAction) if a.text() == "Undo").isEnabled()
    press_keys(window, "Ctrl+Shift+Z")
    assert controller.state.values == moved
    wait_idle(qtbot, controller)


def test_previews_are_seen_while_the_mouse_moves(ready, qtbot):
    window, controller = ready
    slider = window.covariates.rows["age"].slider
    seen: set[float] = set()
    steps = itertools.count()

    def moved() -> bool:
        QTest.mouseMove(slider, at(slider, 0.1 + 0.8 * (next(steps) % 60) / 60))
        seen.update(value for _, value in controller.shown[AGE_ONLY].request.values)
        return len(seen) >= 4

    QTest.mousePress(slider, Qt.MouseButton.LeftButton, pos=at(slider, 0.1))
    qtbot.waitUntil(moved)
    QTest.mouseRelease(slider, Qt.MouseButton.LeftButton, pos=at(slider, 0.9))
    assert "Preview" in window.status.text()
    wait_idle(qtbot, controller)
    assert "Exact" in window.status.text()


def test_the_window_answers_while_a_surface_is_computed(ready, qtbot, atlas):
    window, controller = ready
    atlas.gate.clear()
    answered_during_work: list[bool] = []
    timer = QTimer(window, interval=10)
    timer.timeout.connect(lambda: answered_during_work.append(atlas.running > 0))
    timer.start()
    window.covariates.value_settled.emit("weight", 60.0)
    qtbot.waitUntil(lambda: sum(answered_during_work) >= 20)
    timer.stop()
    assert controller.is_busy
    qtbot.waitUntil(window.cancel.isVisible)
    QTest.mouseClick(window.cancel, Qt.MouseButton.LeftButton)
    wait_idle(qtbot, controller)
    assert "Stopped" in window.status.text()
    assert not window.progress.isVisible()
    assert atlas.running == 0


def test_an_unforeseen_error_reaches_the_user_in_words(ready, qtbot, capsys):
    window, controller = ready
    error = ZeroDivisionError("division by zero")
    controller.report(ZeroDivisionError, error, None)
    assert "ZeroDivisionError: division by zero" in window.error_text.text()
    assert "ZeroDivisionError" in capsys.readouterr().err


def test_the_scale_bar_follows_the_zoom(ready, qtbot):
    window, _ = ready
    pause(0.03)
    before = window.scale.pixels_per_mm
    window.shapes.canvas.camera.parallel_scale /= 2
    window.shapes.canvas.refresh()
    qtbot.waitUntil(lambda: window.scale.pixels_per_mm == pytest.approx(2 * before), timeout=30_000)


def test_undo_and_reset_by_keyboard(ready, qtbot):
    window, controller = ready
    slider = window.covariates.rows["age"].slider
    QTest.mouseClick(slider, Qt.MouseButton.LeftButton, pos=at(slider, 0.9))
    changed = controller.state.values
    window.activateWindow()
    press_keys(window, "Ctrl+Z")
    assert controller.state.values == (100.0, 35.0, 0.0)
    assert window.covariates.rows["age"].box.value == 100.0
    press_keys(window, "Ctrl+Shift+Z")
    assert controller.state.values == changed
    qtbot.waitUntil(window.isActiveWindow)  # only then it hears keys
    for keys, values in ((Qt.Key.Key_Z, (100.0, 35.0, 0.0)), (Qt.Key.Key_Y, changed)):
        QTest.keyClick(window, keys, Qt.KeyboardModifier.ControlModifier)
        assert controller.state.values == values
    press_keys(window, "Ctrl+R")
    assert controller.state.values == (100.0, 35.0, 0.0)
    wait_idle(qtbot, controller)


def test_keys_and_clicks_reach_the_window_while_a_number_is_typed(ready, qtbot):
    """What people do: type a value, press Enter, undo it, type another, click the shapes."""
    window, controller = ready
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    box = window.covariates.rows["age"].box

    def write(text: str) -> None:
        QTest.mouseClick(box, Qt.MouseButton.LeftButton)
        QTest.keyClick(box, Qt.Key.Key_A, Qt.KeyboardModifier.ControlModifier)
        QTest.keyClicks(box, text)

    write("153.5")
    QTest.keyClick(box, Qt.Key.Key_Return)
    assert controller.state.values[0] == 153.5 and box.text() == "153.5" and box.hasFocus()
    for keys, modifiers, age in (
        (Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier, 100.0),
        (Qt.Key.Key_Y, Qt.KeyboardModifier.ControlModifier, 153.5),
        (Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier, 100.0),
        (Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.ShiftModifier, 153.5),
    ):
        QTest.keyClick(box, keys, modifiers)
        assert controller.state.values[0] == age and box.value == age
    write("7")
    QTest.keyClick(box, Qt.Key.Key_Escape)
    assert box.text() == "153.5" and controller.state.values[0] == 153.5
    write("60,5")
    QTest.mouseClick(window.shapes.canvas, Qt.MouseButton.LeftButton, pos=QPoint(200, 200))
    assert not box.hasFocus() and controller.state.values[0] == 60.5
    qtbot.waitUntil(lambda: not controller.is_moving and not controller.is_busy, timeout=30_000)


def test_layouts_and_views_by_menu(ready, qtbot):
    window, controller = ready
    press_keys(window, "Ctrl+2")
    assert controller.state.layout is Layout.FULL_SHAPE
    assert not window.shapes.title(AGE_ONLY).isVisible()
    press_keys(window, "Ctrl+1")
    assert window.shapes.title(AGE_ONLY).isVisible()
    for number in range(1, 7):
        press_keys(window, f"Alt+{number}")
        pause(0.005)
    press_keys(window, "Ctrl+0")
    wait_idle(qtbot, controller)


def test_a_dropped_file_is_opened_and_remembered(open_window, qtbot, atlas_file):
    window, controller = open_window()
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(atlas_file))])
    copy, button, keys = Qt.DropAction.CopyAction, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
    window.dropEvent(QDropEvent(QPointF(500, 300), copy, data, button, keys))
    qtbot.waitUntil(lambda: FULL_SHAPE in controller.shown, timeout=30_000)
    assert window.windowTitle().startswith("ellipsoid")
    (recent,) = [menu for menu in window.findChildren(QMenu) if menu.title() == "Open recent"]
    assert atlas_file.name in recent.actions()[0].text()
    wait_idle(qtbot, controller)


def test_a_foreign_file_is_explained_in_the_window(ready, qtbot, tmp_path):
    window, controller = ready
    foreign = tmp_path / "notes.txt"
    foreign.write_text("hello")
    window.open_requested.emit(foreign)
    qtbot.waitUntil(lambda: "notes.txt is not an atlas file" in window.error_text.text(), timeout=30_000)
    assert window.error_text.isVisible()
    (dismiss,) = [b for b in window.findChildren(QPushButton) if b.text() == "Dismiss"]
    QTest.mouseClick(dismiss, Qt.MouseButton.LeftButton)
    assert not window.error_text.isVisible()
    wait_idle(qtbot, controller)


def test_the_open_dialog_opens_what_is_chosen(open_window, qtbot, atlas_file, monkeypatch):
    window, controller = open_window()
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *_: (str(atlas_file), ""))
    press_keys(window, "Ctrl+O")
    qtbot.waitUntil(lambda: FULL_SHAPE in controller.shown, timeout=30_000)
    wait_idle(qtbot, controller)


def test_the_export_dialog_is_filled_in_and_accepted(ready, qtbot, tmp_path: Path):
    window, controller = ready

    def fill_in() -> None:
        (dialog,) = window.findChildren(ExportDialog)
        dialog.what.setCurrentIndex(dialog.what.findText("Age only"))
        dialog.format.setCurrentText("GLB")
        dialog.folder.setText(str(tmp_path / "out"))
        (button,) = [b for b in dialog.findChildren(QPushButton) if b.text() == "Export"]
        QTest.mouseClick(button, Qt.MouseButton.LeftButton)

    QTimer.singleShot(100, fill_in)
    press_keys(window, "Ctrl+E")
    qtbot.waitUntil(lambda: "Exported 1 surface" in window.status.text(), timeout=30_000)
    assert {p.name for p in (tmp_path / "out").iterdir()} == {
        "ellipsoid-age-only_age100.glb",
        "ellipsoid-age-only_age100.glb.json",
    }
    wait_idle(qtbot, controller)
    assert window.covariates.isEnabled()


def test_a_saved_picture_shows_shapes_and_panel(ready, qtbot, tmp_path, monkeypatch):
    window, controller = ready
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(tmp_path / "picture"), ""))
    press_keys(window, "Ctrl+S")
    image = window.grab_image()
    assert (tmp_path / "picture.png").stat().st_size > 10_000
    assert len({image.pixel(x, y) for x in range(340, 960, 7) for y in range(80, 600, 7)}) > 100
    wait_idle(qtbot, controller)


def test_the_theme_reaches_everything(ready, qtbot):
    window, controller = ready
    controller.set_theme(ThemeChoice.DARK)
    pause(0.05)
    image = window.grab_image()
    for place in (QPoint(5, 560), QPoint(800, 75), QPoint(900, 110)):
        assert image.pixelColor(place).lightness() < 90
    assert window.shapes.canvas.renderers[0].background_color.hex_rgb == DARK.canvas
    controller.set_theme(ThemeChoice.LIGHT)


def test_windows_open_and_close_without_leaving_anything(open_window, qtbot, atlas_file, atlas):
    warnings = vtkStringOutputWindow()
    before_window = vtkOutputWindow.GetInstance()
    vtkOutputWindow.SetInstance(warnings)
    threads = threading.active_count()
    closed: list[bool] = []
    try:
        for _ in range(10):
            pair = [open_window((800, 600)), open_window((800, 600))]
            for _window, controller in pair:
                controller.open(atlas_file)
            qtbot.waitUntil(lambda pair=pair: all(c.shown for _, c in pair), timeout=30_000)
            for window, _ in pair:
                assert window.shapes.canvas is not None
                window.shapes.canvas.destroyed.connect(lambda: closed.append(True))
            for window, _ in pair:  # in the middle of the exact surfaces
                window.close()
            assert threading.active_count() == threads
            assert atlas.running == 0
            assert not any(window.shapes.is_ready or window.shapes.canvas for window, _ in pair)
            active = [
                t for window, c in pair for t in (*window.findChildren(QTimer), *c.findChildren(QTimer))
            ]
            assert not [timer for timer in active if timer.isActive()]
            pause(0.01)
            assert len(closed) == 2
            closed.clear()
    finally:
        vtkOutputWindow.SetInstance(before_window)
    gc.collect()
    assert warnings.GetOutput() == ""
    surfaces = {size for what, _, size in atlas.calls if what != "tabulate"}
    assert surfaces <= {EXACT_RESOLUTION, PREVIEW_RESOLUTION}
