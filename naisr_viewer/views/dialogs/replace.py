"""Whether files that are there already are replaced."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QMessageBox, QWidget

NAMED = 6
"""How many files are named; the rest is counted."""


def ask_replace(parent: QWidget, files: Sequence[Path]) -> bool:
    """Whether these files may be replaced; nothing is written otherwise."""
    dialog = QMessageBox(parent)
    dialog.setIcon(QMessageBox.Icon.Warning)
    dialog.setWindowTitle("Replace files")
    dialog.setTextFormat(Qt.TextFormat.PlainText)
    count = "This file is" if len(files) == 1 else f"These {len(files)} files are"
    dialog.setText(f"{count} there already, in {files[0].parent}:")
    rest = [f"and {len(files) - NAMED} more"] if len(files) > NAMED else []
    dialog.setInformativeText("\n".join([*(file.name for file in files[:NAMED]), *rest]))
    replace = dialog.addButton("Replace", QMessageBox.ButtonRole.DestructiveRole)
    dialog.setDefaultButton(dialog.addButton(QMessageBox.StandardButton.Cancel))
    dialog.exec()
    is_wanted = dialog.clickedButton() is replace
    dialog.deleteLater()
    return is_wanted
