"""How long a millimetre is on screen; the same in every sub-plot."""

from __future__ import annotations

import math

from PySide6.QtCore import QPointF, QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent, QPalette, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from naisr_viewer.words.numbers import MILLIMETRES

LONGEST_PX = 90


def round_length_mm(pixels_per_mm: float) -> float:
    """The longest of 1, 2, 5, 10, 20, 50 ... mm that is at most :data:`LONGEST_PX` long."""
    longest = LONGEST_PX / pixels_per_mm
    decade = 10.0 ** math.floor(math.log10(longest))
    return max(step * decade for step in (1, 2, 5) if step * decade <= longest)


class ScaleBar(QWidget):
    """A line and how many millimetres it stands for."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.pixels_per_mm, self.unit = 1.0, MILLIMETRES
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.setToolTip("All views are drawn to this scale")

    def set_scale(self, pixels_per_mm: float) -> None:
        """Follow the zoom."""
        self.pixels_per_mm = pixels_per_mm
        self.update()

    def show_unit(self, unit: str) -> None:
        """Tell lengths in another unit."""
        self.unit = unit
        self.update()

    def sizeHint(self) -> QSize:
        """Room for the longest line and its label."""
        return QSize(LONGEST_PX + 78, 24)

    def paintEvent(self, _event: QPaintEvent) -> None:
        """The label at the right end, the line before it."""
        length_mm = round_length_mm(self.pixels_per_mm)
        painter = QPainter(self)
        text = f"{length_mm:,.0f} {self.unit}" if length_mm >= 1 else f"{length_mm:g} {self.unit}"
        room = painter.fontMetrics().horizontalAdvance(text) + 14
        right, middle = self.width() - room - 6.0, self.height() / 2
        left = right - length_mm * self.pixels_per_mm
        painter.setPen(QPen(self.palette().color(QPalette.ColorRole.PlaceholderText), 1.5))
        painter.drawLine(QPointF(left, middle), QPointF(right, middle))
        for end in (left, right):
            painter.drawLine(QPointF(end, middle - 4), QPointF(end, middle + 4))
        painter.drawText(
            self.rect().adjusted(0, 0, -14, 0),
            Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter,
            text,
        )
        painter.end()
