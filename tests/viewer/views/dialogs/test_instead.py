"""A scan chosen as an atlas, and the other way round."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QFileDialog, QMessageBox

from naisr_viewer.views.main_window import MainWindow


@pytest.fixture
def window(qtbot):
    window = MainWindow()
    yield window
    window.close()
    window.deleteLater()


@pytest.mark.parametrize("act", ["ask_atlas", "ask_scan"])
@pytest.mark.parametrize("answer", ["&Open as", "Cancel"])
@pytest.mark.parametrize("name", ["p01.stl", "p01.NII.GZ", "a.safetensors"])
def test_a_file_is_opened_as_what_it_is_or_not_at_all(window, monkeypatch, act, answer, name):
    """A mesh handed to the reader of atlases would only be called a damaged atlas."""
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *_: (f"/data/{name}", ""))
    opened: list[tuple[str, Path]] = []
    window.open_requested.connect(lambda path: opened.append(("atlas", path)))
    window.scan_requested.connect(lambda path: opened.append(("scan", path)))
    asked: list[str] = []

    def reply() -> None:
        (dialog,) = window.findChildren(QMessageBox)
        asked.append(dialog.text())
        (button,) = [each for each in dialog.buttons() if answer.strip("&") in each.text().replace("&", "")]
        button.click()

    timer = QTimer(window, singleShot=True, interval=50)
    timer.timeout.connect(reply)
    is_a, wanted = "atlas" if name.endswith("safetensors") else "scan", act.removeprefix("ask_")
    if is_a != wanted:
        timer.start()
    getattr(window, act)()
    assert bool(asked) == (is_a != wanted)
    assert opened == ([] if asked and answer == "Cancel" else [(is_a, Path(f"/data/{name}"))])
