"""What stands in the centre before the first atlas."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QFrame, QLabel, QPushButton, QVBoxLayout, QWidget

from naisr_viewer.views.elided import ElidedLabel

ZONE_PX = 420


class EmptyPage(QFrame):
    """Invites to open an atlas, or says that one is being opened."""

    open_requested = Signal()  # "Open atlas…" was pressed

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setObjectName("canvasArea")
        self._invitation = ElidedLabel("", self)
        self._invitation.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._invitation.setObjectName("emptyTitle")
        hint = QLabel("a .safetensors file made by “naisr train”, or", self)
        hint.setObjectName("muted")
        self.button = QPushButton("Open atlas…", self)
        self.button.clicked.connect(self.open_requested)
        zone = QFrame(self)
        zone.setObjectName("dropZone")
        zone.setMinimumWidth(ZONE_PX)
        column = QVBoxLayout(zone)
        column.setContentsMargins(40, 40, 40, 40)
        column.setSpacing(12)
        self._invited = (hint, self.button)
        column.addWidget(self._invitation)
        for widget in self._invited:
            column.addWidget(widget, 0, Qt.AlignmentFlag.AlignHCenter)
        outer = QVBoxLayout(self)
        outer.addStretch(1)
        outer.addWidget(zone, 0, Qt.AlignmentFlag.AlignHCenter)
        outer.addStretch(1)
        self.show_opening("")

    def show_opening(self, name: str) -> None:
        """Say that a file is being opened; an empty name invites to open one."""
        self._invitation.setText(f"Opening {name} …" if name else "Drop an atlas here")
        for widget in self._invited:
            widget.setVisible(not name)
