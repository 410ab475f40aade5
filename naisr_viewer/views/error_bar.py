"""What went wrong, above the shapes."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QScrollArea, QSizePolicy, QWidget

from naisr_viewer.words.patients import breakable

LEAST_PX = 36
MOST_PX = 120
"""Height of a message; a longer one is scrolled."""


class ErrorBar(QFrame):
    """A message that stays until it is dismissed."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setObjectName("errorBar")
        self.text = QLabel(self)
        self.text.setWordWrap(True)
        self.text.setTextFormat(Qt.TextFormat.PlainText)
        self.text.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.text.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self._area = QScrollArea(self)
        self._area.setWidget(self.text)
        self._area.setWidgetResizable(True)
        self._area.setMinimumWidth(LEAST_PX)
        self._area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.dismiss = QPushButton("Dismiss", self)
        self.dismiss.clicked.connect(lambda: self.show_message(""))
        row = QHBoxLayout(self)
        row.setContentsMargins(14, 8, 10, 8)
        row.addWidget(self._area, 1)
        row.addWidget(self.dismiss, 0, Qt.AlignmentFlag.AlignTop)
        self.hide()

    @property
    def stops(self) -> list[QWidget]:
        """What the Tab key goes through, as it is read."""
        return [self._area, self.dismiss]

    def show_message(self, message: str) -> None:
        """Say what went wrong; an empty message hides the bar."""
        self.text.setText(breakable(message))
        self.setVisible(bool(message))
        self._make_room()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """The message may need more lines now, or fewer."""
        super().resizeEvent(event)
        self._make_room()

    def _make_room(self) -> None:
        wanted = self.text.heightForWidth(self._area.viewport().width())
        self._area.setFixedHeight(min(max(wanted, self.dismiss.sizeHint().height()), MOST_PX))
