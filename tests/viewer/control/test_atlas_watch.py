"""An atlas file that is replaced while it is open."""

from __future__ import annotations

import os

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QPushButton


@pytest.fixture
def ready(whole_window, qtbot, engine, atlas_file):
    window, controller = whole_window(engine)
    controller.open(atlas_file)
    qtbot.waitUntil(lambda: bool(controller.shown) and not controller.is_busy, timeout=30_000)
    return window, controller


def replace_file(path) -> None:
    """As a training does: another file is put in its place."""
    other = path.with_suffix(".tmp")
    other.write_bytes(path.read_bytes())
    os.utime(other, (1, 1))
    os.replace(other, path)


def told(window) -> list[str]:
    return [
        each.text() for each in window.findChildren(QLabel) if each.isVisible() and "changed" in each.text()
    ]


def press(window, text: str) -> None:
    (button,) = [
        each for each in window.findChildren(QPushButton) if each.isVisible() and each.text() == text
    ]
    QTest.mouseClick(button, Qt.MouseButton.LeftButton)


def test_a_replaced_atlas_is_told_of_and_opened_again(ready, qtbot, atlas_file):
    window, controller = ready
    assert told(window) == []
    replace_file(atlas_file)
    qtbot.waitUntil(lambda: bool(told(window)), timeout=30_000)
    assert atlas_file.name in told(window)[0] and controller.state.values == (100.0, 35.0, 0.0)
    before = controller.state.atlas
    press(window, "Open again")
    qtbot.waitUntil(lambda: controller.state.atlas is not before, timeout=30_000)
    qtbot.waitUntil(lambda: not controller.is_busy, timeout=30_000)
    assert told(window) == [] and not controller.state.is_atlas_changed


def test_what_was_put_off_stays_away(ready, qtbot, atlas_file):
    window, controller = ready
    replace_file(atlas_file)
    qtbot.waitUntil(lambda: bool(told(window)), timeout=30_000)
    press(window, "Not now")
    controller.settle("age", 150.0)
    qtbot.waitUntil(lambda: not controller.is_busy, timeout=30_000)
    assert told(window) == [] and controller.state.is_atlas_changed


def test_a_file_that_is_gone_takes_nothing_with_it(ready, qtbot, atlas_file):
    window, controller = ready
    atlas_file.unlink()
    qtbot.wait(200)
    controller.settle("age", 150.0)
    qtbot.waitUntil(lambda: not controller.is_busy, timeout=30_000)
    assert told(window) == [] and not window.error_text.text()
