"""What stands in the centre before the first atlas."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QFrame, QLabel, QPushButton, QVBoxLayout, QWidget


class EmptyPage(QFrame):
    """Invites to open an atlas, or says that one is being opened."""

    open_requested = Signal()  # "Open atlas…" was pressed

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setObjectName("canvasArea")
        self._invitation = QLabel(self)
        self._invitation.setObjectName("emptyTitle")
        hint = QLabel("a .safetensors file made by “naisr train”, or", self)
        hint.setObjectName("muted")
        button = QPushButton("Open atlas…", self)
        button.clicked.connect(self.open_requested)
        zone = QFrame(self)
        zone.setObjectName("dropZone")
        column = QVBoxLayout(zone)
        column.setContentsMargins(70, 54, 70, 54)
        column.setSpacing(12)
        self._invited = (hint, button)
        for widget in (self._invitation, *self._invited):
            column.addWidget(widget, 0, Qt.AlignmentFlag.AlignHCenter)
        outer = QVBoxLayout(self)
        outer.addWidget(zone, 0, Qt.AlignmentFlag.AlignCenter)
        self.show_opening("")

    def show_opening(self, name: str) -> None:
        """Say that a file is being opened; an empty name invites to open one."""
        self._invitation.setText(f"Opening {name} …" if name else "Drop an atlas here")
        for widget in self._invited:
            widget.setVisible(not name)
