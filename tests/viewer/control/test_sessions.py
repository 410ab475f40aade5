"""Sessions in the window: what is saved is seen again, pixel by pixel, and what is left is kept."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from eggs import egg
from numpy.typing import NDArray
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QAction, QImage
from PySide6.QtTest import QTest

from naisr_viewer.app import main
from naisr_viewer.engine.engine import Engine
from naisr_viewer.files.sessions import read_session
from naisr_viewer.program.headless import finish, wait_until
from naisr_viewer.program.start import make_window
from naisr_viewer.state.layouts import Layout
from naisr_viewer.views.dialogs import files
from naisr_viewer.views.shapes.canvas import Canvas


@pytest.fixture
def fitted(whole_window, egg_atlas, egg_cache, tmp_path):
    """A patient fitted and moved, a place pinned, the shapes turned and seen from nearer."""
    window, controller = whole_window(Engine(folder=egg_cache))
    controller.open(egg_atlas)
    finish(window, controller)
    egg(6.0, 1.0).export(tmp_path / "p01.stl")
    window.scan_requested.emit(tmp_path / "p01.stl")
    finish(window, controller)
    window.patients.known.fit.click()
    finish(window, controller)
    window.layout_requested.emit(Layout.CHANGE)
    window.covariates.value_settled.emit("age", 3.0)
    finish(window, controller)
    canvas = window.findChild(Canvas)
    place = QPoint(canvas.width() // 2, canvas.height() // 2)
    QTest.mouseClick(canvas, Qt.MouseButton.LeftButton, pos=place)
    wait_until(lambda: len(controller.state.pins) == 1)  # once it is no double click any more
    finish(window, controller)
    QTest.mousePress(canvas, Qt.MouseButton.LeftButton, pos=place)
    QTest.mouseMove(canvas, place + QPoint(60, 25))
    QTest.mouseRelease(canvas, Qt.MouseButton.LeftButton, pos=place + QPoint(60, 25))
    canvas.camera.zoom(1.3)
    canvas.refresh()
    return window, controller


def pixels(window) -> NDArray[np.uint8]:
    image = window.findChild(Canvas).grab().toImage().convertToFormat(QImage.Format.Format_RGB888)
    rows = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), image.bytesPerLine())
    return rows[:, : 3 * image.width()].copy()


def test_a_session_is_seen_again_pixel_by_pixel(fitted, whole_window, egg_cache, monkeypatch, tmp_path):
    window, controller = fitted
    assert len(controller.state.pins) == 1
    monkeypatch.setattr(files.QFileDialog, "getSaveFileName", lambda *_: (str(tmp_path / "mine"), ""))
    action(window, "Save session…").trigger()
    finish(window, controller)
    assert "Saved" in window.status.text() and (tmp_path / "mine.json").is_file()
    before = pixels(window)
    other, other_controller = whole_window(Engine(folder=egg_cache))
    monkeypatch.setattr(files.QFileDialog, "getOpenFileName", lambda *_: (str(tmp_path / "mine.json"), ""))
    action(other, "Open session…").trigger()
    finish(other, other_controller)
    assert other_controller.state.named == controller.state.named
    assert other_controller.state.pins == controller.state.pins
    assert (pixels(other) == before).all()
    assert len(np.unique(before)) > 50  # there is something to be seen


def action(window, text: str) -> QAction:
    return next(each for each in window.findChildren(QAction) if each.text() == text)


def test_what_is_on_screen_is_kept_for_the_next_run(qtbot, egg_atlas, egg_cache, tmp_path):
    kept, settings = tmp_path / "state" / "session.json", tmp_path / "settings.ini"

    def run(act) -> None:
        window, controller = make_window(Engine(folder=egg_cache), settings, True, kept)
        with qtbot.waitExposed(window):
            window.show()
        try:
            act(window, controller)
        finally:
            window.close()
            window.deleteLater()
            qtbot.wait(0)

    def first(window, controller) -> None:
        assert not action(window, "Go on where you left").isEnabled()
        controller.open(egg_atlas)
        finish(window, controller)
        window.covariates.value_settled.emit("age", 7.5)
        qtbot.waitUntil(kept.is_file, timeout=30_000)

    def second(window, controller) -> None:
        controller.open(egg_atlas)
        finish(window, controller)
        action(window, "Go on where you left").trigger()
        finish(window, controller)
        assert dict(controller.state.named)["age"] == 7.5

    run(first)
    assert read_session(kept).state.values[0] == 7.5
    run(second)


def test_a_place_that_cannot_be_written_is_told_and_nothing_is_left(fitted, tmp_path):
    window, controller = fitted
    (tmp_path / "file").write_text("")
    controller.refinement.forget_errors()
    window.session_place_chosen.emit(tmp_path / "file" / "s.json")
    with pytest.raises(Exception, match="annot write"):
        finish(window, controller)
    assert list(tmp_path.glob("*.json")) == []


def test_a_session_says_all_that_is_shown(capsys, tmp_path):
    assert main(["--session", str(tmp_path / "s.json"), "--set", "age=3"]) == 2
    assert "--session says what is shown; leave out" in capsys.readouterr().err
    assert main(["--session", str(tmp_path / "s.json"), "--screenshot", str(tmp_path / "a.png")]) == 2
    assert "s.json" in capsys.readouterr().err
    assert list(Path(tmp_path).iterdir()) == []
