"""That the atlas has changed on disk, above the shapes."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QWidget


class ChangedBar(QFrame):
    """Offers to open the atlas again, until that is put off."""

    reopen_requested = Signal()  # "Open again" was pressed

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setObjectName("changed")
        self._text = QLabel(self)
        self._text.setTextFormat(Qt.TextFormat.PlainText)
        self._text.setWordWrap(True)
        reopen, later = QPushButton("Open again", self), QPushButton("Not now", self)
        self.stops: list[QWidget] = [reopen, later]
        reopen.clicked.connect(self.reopen_requested)
        later.clicked.connect(self.hide)
        row = QHBoxLayout(self)
        row.setContentsMargins(16, 8, 12, 8)
        row.addWidget(self._text, 1)
        row.addWidget(reopen)
        row.addWidget(later)
        self.hide()

    def show_changed(self, name: str) -> None:
        """Say which file has changed; an empty name hides the bar."""
        self._text.setText(f"{name} has changed on disk; what is shown is of the file as it was.")
        self.setVisible(bool(name))
