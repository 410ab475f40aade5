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


@pytest.fixture(autouse=True)
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """Measures along a covariate need not be fine here."""
    monkeypatch.setattr("naisr_model.measures.curves.COARSE", 24)


@pytest.fixture(scope="session")
def egg_cache(egg_atlas: Path, made_once) -> Path:
    """What an engine keeps on disk of the atlas of the eggs once all of it is worked out."""

    def work_out(folder: Path) -> None:
        engine = Engine(folder=folder)
        engine.open(egg_atlas)
        engine.prepare_previews(egg_atlas)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("naisr_model.measures.curves.COARSE", 24)
            engine.norms(egg_atlas)

    return Path(made_once("egg-cache", work_out))


@pytest.fixture
def whole_window(qtbot: QtBot, tmp_path: Path) -> Iterator[Callable[[Engine], tuple[MainWindow, Controller]]]:
    """Windows on an engine, shown, and closed at the end."""
    made = []

    def make(engine: Engine) -> tuple[MainWindow, Controller]:
        window, controller = make_window(engine, tmp_path / "settings.ini")
        made.append(window)
        window.resize(1280, 800)
        with qtbot.waitExposed(window):
            window.show()
        return window, controller

    yield make
    for window in made:
        window.close()
        window.deleteLater()
    made.clear()
    qtbot.wait(0)
    gc.collect()
