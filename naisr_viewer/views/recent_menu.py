"""The atlases that were opened lately."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QMenu, QWidget


class RecentMenu(QMenu):
    """One entry per file."""

    file_chosen = Signal(Path)  # an entry was chosen

    def __init__(self, parent: QWidget) -> None:
        super().__init__("Open recent", parent)

    def show_files(self, paths: Sequence[Path]) -> None:
        """Offer these files; without any there is nothing to choose."""
        self.clear()
        self.setEnabled(bool(paths))
        for path in paths:
            action = self.addAction(f"{path.name}   {path.parent}")
            action.triggered.connect(lambda _, path=path: self.file_chosen.emit(path))
