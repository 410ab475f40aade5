"""The whole window as the program makes it: with its patients, and files that are watched."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from pytestqt.qtbot import QtBot

from naisr_viewer.control.controller import Controller
from naisr_viewer.engine.engine import Engine
from naisr_viewer.program.start import make_window
from naisr_viewer.views.main_window import MainWindow


@pytest.fixture
def whole_window(qtbot: QtBot, tmp_path: Path) -> Iterator[Callable[[Engine], tuple[MainWindow, Controller]]]:
    """Windows on an engine, shown, and closed at the end."""
    made = []

    def make(engine: Engine) -> tuple[MainWindow, Controller]:
        window, controller = make_window(engine, tmp_path / "settings.ini")
        made.append(window)
        window.resize(1280, 800)
        window.show()
        qtbot.waitExposed(window)
        return window, controller

    yield make
    for window in made:
        window.close()
        window.deleteLater()
    made.clear()
    qtbot.wait(0)
    gc.collect()
