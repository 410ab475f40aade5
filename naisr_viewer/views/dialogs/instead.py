"""Asked where a file was chosen for something else than it is."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QMessageBox, QWidget

from naisr_viewer.words.patients import breakable


def ask_instead(parent: QWidget, file: Path, is_a: str) -> bool:
    """Whether a file shall be opened as what it is.

    Args:
        parent: the window that waits.
        file: what was chosen.
        is_a: what its name says that it is: ``scan`` or ``atlas``.
    """
    dialog = QMessageBox(parent)
    dialog.setIcon(QMessageBox.Icon.Question)
    dialog.setWindowTitle(f"Open as {is_a}")
    dialog.setTextFormat(Qt.TextFormat.PlainText)
    dialog.setText(
        breakable(f"{file.name} is no {'atlas' if is_a == 'scan' else 'scan'} but, by its name, a {is_a}.")
    )
    as_it_is = dialog.addButton(f"&Open as {is_a}", QMessageBox.ButtonRole.AcceptRole)
    dialog.addButton(QMessageBox.StandardButton.Cancel)
    dialog.setDefaultButton(as_it_is)
    dialog.exec()
    is_wanted = dialog.clickedButton() is as_it_is
    dialog.deleteLater()
    return is_wanted
