"""The atlases that were opened lately."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QMenu, QWidget

from naisr_viewer.words.titles import as_entry, as_tip

LETTERS = 60
"""Of a name and its folder that are shown; the whole of them is told on hover."""


def told(path: Path) -> str:
    """The name of a file and where it is, without their middle where they are long."""
    return f"{_short(path.name)}   {_short(str(path.parent))}"


def _short(text: str) -> str:
    half = LETTERS // 2
    return text if len(text) <= LETTERS else f"{text[:half]}…{text[-half:]}"


class RecentMenu(QMenu):
    """One entry per file."""

    file_chosen = Signal(Path)  # an entry was chosen

    def __init__(self, parent: QWidget) -> None:
        super().__init__("Open recent", parent)

    def show_files(self, paths: Sequence[Path]) -> None:
        """Offer these files; without any there is nothing to choose."""
        self.clear()
        self.setEnabled(bool(paths))
        self.setToolTipsVisible(True)
        for path in paths:
            action = self.addAction(as_entry(told(path)))
            action.setToolTip(as_tip(str(path)))
            action.triggered.connect(lambda _, path=path: self.file_chosen.emit(path))
