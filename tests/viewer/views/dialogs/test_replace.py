"""Whether files that are there already are replaced."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtCore import Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QMessageBox, QWidget

from naisr_viewer.views.dialogs.replace import NAMED, ask_replace

FILES = [Path(f"/out/eggs-{number}.stl") for number in range(NAMED + 2)]


@pytest.mark.parametrize(("answer", "is_wanted"), [("Replace", True), ("Cancel", False), (None, False)])
def test_only_a_yes_replaces(qtbot, answer, is_wanted):
    parent = QWidget()
    qtbot.addWidget(parent)
    seen = []

    def press() -> None:
        dialog = QApplication.activeModalWidget()
        assert isinstance(dialog, QMessageBox)
        seen.append(f"{dialog.text()}\n{dialog.informativeText()}")
        buttons = {button.text().replace("&", ""): button for button in dialog.buttons()}
        if answer:
            QTest.mouseClick(buttons[answer], Qt.MouseButton.LeftButton)
        else:
            QTest.keyClick(dialog, Qt.Key.Key_Escape)

    QTimer.singleShot(0, press)
    assert ask_replace(parent, FILES) is is_wanted
    assert "These 8 files are there already, in /out:\neggs-0.stl" in seen[0] and "and 2 more" in seen[0]
