"""Which colour stands for which number."""

from __future__ import annotations

from PySide6.QtCore import QLineF, QPointF, QRectF, QSize
from PySide6.QtGui import QLinearGradient, QPainter, QPaintEvent, QPalette, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from naisr_viewer.state.requests import Scale
from naisr_viewer.views.colours import SCALE_COLOURS

WIDTH_PX = 300
HEIGHT_PX = 38
BAND_PX = 10
"""Height of the colours."""

WIDEST = "+88.8"
"""The colours leave room for half of such a number beside them, and for the unit."""


def labels(limit: float, scale: Scale) -> tuple[str, str, str]:
    """What stands at the low end, the middle and the high end of a scale, without the unit."""
    if scale == "signed":
        return f"−{limit:g}", "0", f"+{limit:g}"
    return "0", f"{limit / 2:g}", f"{limit:g}"


class ColourBar(QWidget):
    """The colours of a scale with its ends and its middle.

    Args:
        scale: from minus to plus its limit, or from 0.
        unit: of the numbers.
        parent: the widget around it.
    """

    def __init__(self, scale: Scale, unit: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._scale: Scale = scale
        self._unit = f" {unit}"
        self.limit: float | None = None
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)

    def set_limit(self, limit: float) -> None:
        """Say what the end of the scale stands for; until then there are colours without numbers."""
        if limit != self.limit:
            self.limit = limit
            self.update()

    def sizeHint(self) -> QSize:
        """Room for the colours, and the labels beneath."""
        return QSize(WIDTH_PX, HEIGHT_PX)

    @property
    def band(self) -> QRectF:
        """Where the colours are."""
        advance = self.fontMetrics().horizontalAdvance
        margin = round(advance(WIDEST) / 2 + advance(self._unit)) + 2.5
        return QRectF(margin, 4.5, self.width() - 2 * margin, BAND_PX)

    def paintEvent(self, _event: QPaintEvent) -> None:
        """The colours, and beneath them three labels with their ticks."""
        painter, band = QPainter(self), self.band
        painter.fillRect(band, self._gradient(band))
        painter.setPen(QPen(self.palette().color(QPalette.ColorRole.Mid), 1.0))
        painter.drawRect(band)
        if self.limit is not None:
            painter.setPen(self.palette().color(QPalette.ColorRole.WindowText))
            low, middle, high = labels(self.limit, self._scale)
            _draw_label(painter, band.bottomLeft(), low)
            _draw_label(painter, QPointF(round(band.center().x()) + 0.5, band.bottom()), middle)
            _draw_label(painter, band.bottomRight(), high, self._unit)
        painter.end()

    def _gradient(self, band: QRectF) -> QLinearGradient:
        gradient = QLinearGradient(band.topLeft(), band.topRight())
        colours = SCALE_COLOURS[self._scale]
        for index, colour in enumerate(colours):
            gradient.setColorAt(index / (len(colours) - 1), colour)
        return gradient


def _draw_label(painter: QPainter, place: QPointF, number: str, unit: str = "") -> None:
    """A tick downwards, and the number centred under it with its unit behind."""
    painter.drawLine(QLineF(place, place + QPointF(0.0, 3.0)))
    metrics = painter.fontMetrics()
    left = round(place.x() - metrics.horizontalAdvance(number) / 2)
    painter.drawText(QPointF(left, round(place.y() + 4 + metrics.ascent())), number + unit)
