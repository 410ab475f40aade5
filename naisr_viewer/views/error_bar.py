"""What went wrong, above the shapes."""

from __future__ import annotations

import math

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent, QTextOption
from PySide6.QtWidgets import QFrame, QHBoxLayout, QPushButton, QTextEdit, QWidget

LEAST_PX = 36
MOST_PX = 120
"""Height of a message; a longer one is scrolled."""


class Message(QTextEdit):
    """Words over as many lines as there is room for; paths are broken anywhere, and can be copied whole."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setReadOnly(True)
        self.setTabChangesFocus(True)
        self.setMinimumWidth(LEAST_PX)
        self.setAccessibleName("What went wrong")
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setWordWrapMode(QTextOption.WrapMode.WrapAtWordBoundaryOrAnywhere)

    def text(self) -> str:
        """What it says."""
        return self.toPlainText()

    @property
    def height_px(self) -> int:
        """Of all lines at the present width."""
        return math.ceil(self.document().size().height()) + 2 * self.frameWidth() + 2


class ErrorBar(QFrame):
    """A message that stays until it is dismissed."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setObjectName("errorBar")
        self.text = Message(self)
        self.dismiss = QPushButton("Dismiss", self)
        self.dismiss.clicked.connect(lambda: self.show_message(""))
        row = QHBoxLayout(self)
        row.setContentsMargins(8, 8, 8, 8)
        row.addWidget(self.text, 1)
        row.addWidget(self.dismiss, 0, Qt.AlignmentFlag.AlignTop)
        self.hide()

    @property
    def stops(self) -> list[QWidget]:
        """What the Tab key goes through, as it is read."""
        return [self.text, self.dismiss]

    def show_message(self, message: str) -> None:
        """Say what went wrong; an empty message hides the bar."""
        self.text.setPlainText(message)
        self.setVisible(bool(message))
        self._make_room()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """The message may need more lines now, or fewer."""
        super().resizeEvent(event)
        self._make_room()

    def _make_room(self) -> None:
        least = self.dismiss.sizeHint().height()
        self.text.setFixedHeight(min(max(self.text.height_px, least), MOST_PX))
