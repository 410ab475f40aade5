"""Which colour stands for which number."""

from __future__ import annotations

from PySide6.QtCore import QLineF, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QLinearGradient, QMouseEvent, QPainter, QPaintEvent, QPalette, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from naisr_viewer.state.requests import Scale
from naisr_viewer.views.colours import SCALE_COLOURS

WIDTH_PX = 300
HEIGHT_PX = 38
BAND_PX = 10
GRIP_PX = 8
"""Nearer to 0 than this no end is drawn."""

"""Height of the colours."""

LINE_PX = 15
LONG_UNIT = 5
"""Letters from which on a unit has a line of its own."""

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

    limit_moved = Signal(float)  # an end of the scale was dragged; what the high end shall stand for
    fit_requested = Signal()  # a double-click: the scale shall fit what is shown

    def __init__(self, scale: Scale, unit: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._scale: Scale = scale
        self._unit = f" {unit}"
        self.limit: float | None = None
        self._grip: tuple[float, float] | None = None  # where an end was taken, and the limit then
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)

    def set_limit(self, limit: float) -> None:
        """Say what the end of the scale stands for; until then there are colours without numbers."""
        if limit != self.limit:
            self.limit = limit
            self.update()

    def show_unit(self, scale: Scale, unit: str) -> None:
        """Say what the numbers are."""
        if (scale, f" {unit}") != (self._scale, self._unit):
            self._scale, self._unit = scale, f" {unit}"
            self.update()

    def sizeHint(self) -> QSize:
        """Room for the colours, the labels beneath, and a line for a long unit."""
        return QSize(WIDTH_PX, HEIGHT_PX + (LINE_PX if self._is_long else 0))

    @property
    def _is_long(self) -> bool:
        """Whether the unit would leave no room for the colours beside it."""
        return len(self._unit) > LONG_UNIT

    @property
    def band(self) -> QRectF:
        """Where the colours are."""
        advance = self.fontMetrics().horizontalAdvance
        beside = 0 if self._is_long else advance(self._unit)
        margin = round(advance(WIDEST) / 2 + beside) + 2.5
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
            _draw_label(painter, band.bottomRight(), high, "" if self._is_long else self._unit)
        if self._is_long:
            line = QRectF(0, self.height() - LINE_PX - 2, self.width(), LINE_PX)
            painter.drawText(line, Qt.AlignmentFlag.AlignCenter, self._unit.strip())
        painter.end()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Take the nearer end."""
        if event.button() is Qt.MouseButton.LeftButton and self.limit is not None:
            self._grip = event.position().x(), self.limit

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Let the end stand for more as it is drawn inwards, and for less outwards."""
        if self._grip is None:
            return
        start, limit = self._grip
        band = self.band
        zero = band.center().x() if self._scale == "signed" else band.left()
        reach = max(abs(start - zero), GRIP_PX)
        now = max((event.position().x() - zero) * (1.0 if start >= zero else -1.0), GRIP_PX)
        self.limit_moved.emit(limit * reach / now)

    def mouseReleaseEvent(self, _event: QMouseEvent) -> None:
        """Leave the end where it is."""
        self._grip = None

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        """Ask for the scale that fits."""
        if event.button() is Qt.MouseButton.LeftButton:
            self.fit_requested.emit()

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
