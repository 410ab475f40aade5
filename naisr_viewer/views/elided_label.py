"""Words of any length on one line."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QFontMetrics, QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import QLabel, QSizePolicy, QWidget

from naisr_viewer.words.titles import as_tip


def shortened(text: str, metrics: QFontMetrics, width_px: int) -> str:
    """As much of a text as there is room for, without its middle where it is too long."""
    return metrics.elidedText(text, Qt.TextElideMode.ElideMiddle, width_px)


class ElidedLabel(QLabel):
    """One line that is shortened in its middle where it does not fit, and then told whole on hover.

    It never asks for more room than there is, and what it says is never taken for markup.

    Args:
        text: what it says.
        parent: the widget around it.
    """

    def __init__(self, text: str = "", parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self._hint = ""
        self.setText(text)

    def setText(self, text: str) -> None:
        """Say something else."""
        super().setText(text)
        self._explain()

    def set_hint(self, hint: str) -> None:
        """What else is told on hover."""
        self._hint = hint
        self._explain()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """There may be room for more now."""
        super().resizeEvent(event)
        self._explain()

    def paintEvent(self, _event: QPaintEvent) -> None:
        """As much of the text as there is room for."""
        painter = QPainter(self)
        room = self.contentsRect()
        painter.drawText(room, self.alignment(), shortened(self.text(), self.fontMetrics(), room.width()))
        painter.end()

    def _explain(self) -> None:
        is_whole = self.fontMetrics().horizontalAdvance(self.text()) <= self.contentsRect().width()
        self.setToolTip(as_tip("\n".join(filter(None, ("" if is_whole else self.text(), self._hint)))))
