"""The slider of a covariate, and how its positions stand for real values."""

from __future__ import annotations

from PySide6.QtCore import QPoint, QRectF, Qt
from PySide6.QtGui import QBrush, QColor, QMouseEvent, QPainter, QPaintEvent, QWheelEvent
from PySide6.QtWidgets import QSlider, QWidget

from naisr_model.covariates import Covariate
from naisr_viewer.views.theme import Theme

SLIDER_STEPS = 1000
"""Positions of a slider; a key press moves ten of them."""

GROOVE_PX = 4
HATCHING = Qt.BrushStyle.Dense5Pattern
"""Of the groove where there are no data."""

HANDLE_PX = 16
"""Diameter of the slider handle; the histogram leaves half of it free on both sides."""


def share_of(covariate: Covariate, value: float) -> float:
    """How far along its range a real value is, 0 to 1."""
    low, high = covariate.range
    share = (value - low) / (high - low) if high > low else 0.0
    return min(max(share, 0.0), 1.0)


def slider_position(covariate: Covariate, value: float) -> int:
    """The slider position nearest to a real value."""
    return round(share_of(covariate, value) * SLIDER_STEPS)


def slider_value(covariate: Covariate, position: int) -> float:
    """The real value at a slider position."""
    low, high = covariate.range
    return low + (high - low) * position / SLIDER_STEPS


def chosen_value(covariate: Covariate, position: int) -> float:
    """The real value that is taken at a slider position: as round as it is shown, and the ends exactly."""
    value = slider_value(covariate, position)
    return value if position in (0, SLIDER_STEPS) else round(value, covariate.decimals)


def track_x(share: float, width: int) -> float:
    """Where the handle's centre is at a share of the range, in pixels from the left of a slider so wide."""
    return HANDLE_PX / 2 + share * (width - HANDLE_PX)


class JumpSlider(QSlider):
    """A slider whose handle comes to where it is pressed, and can be dragged on from there.

    Its groove is solid where there are data, and hatched elsewhere.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(Qt.Orientation.Horizontal, parent)
        self.setRange(0, SLIDER_STEPS)
        self.setSingleStep(SLIDER_STEPS // 100)
        self.setPageStep(SLIDER_STEPS // 10)
        self._stretches: tuple[tuple[float, float], ...] = ((0.0, 1.0),)
        self._rest = self._filled = QColor()

    def position_at(self, x: float) -> int:
        """The slider position under a horizontal pixel coordinate."""
        usable = max(1.0, self.width() - HANDLE_PX)
        return round(min(max((x - HANDLE_PX / 2) / usable, 0.0), 1.0) * SLIDER_STEPS)

    def place_of(self, share: float) -> QPoint:
        """The middle of the handle, in pixels, where it stands at a share of the range."""
        return QPoint(round(track_x(share, self.width())), self.height() // 2)

    def wheelEvent(self, event: QWheelEvent) -> None:
        """The wheel belongs to what scrolls."""
        event.ignore()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Start dragging from the pressed place."""
        if event.button() != Qt.MouseButton.LeftButton:
            return
        self.setSliderDown(True)
        self.setSliderPosition(self.position_at(event.position().x()))

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Follow the pointer."""
        if self.isSliderDown():
            self.setSliderPosition(self.position_at(event.position().x()))

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """End the drag."""
        if event.button() == Qt.MouseButton.LeftButton:
            self.setSliderDown(False)

    def show_stretches(self, stretches: tuple[tuple[float, float], ...]) -> None:
        """Say where there are data, by low and high ends as shares of the range."""
        if stretches != self._stretches:
            self._stretches = stretches
            self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        """The groove, which the style sheet leaves out; then the handle over it."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        handle = track_x(self.value() / SLIDER_STEPS, self.width())
        self._paint_groove(painter, 0.0, handle, self._filled)
        self._paint_groove(painter, handle, float(self.width()), self._rest)
        painter.end()
        super().paintEvent(event)

    def _paint_groove(self, painter: QPainter, left: float, right: float, colour: QColor) -> None:
        """The part between two places: hatched all along, and solid over it where there are data."""
        painter.save()
        top = (self.height() - GROOVE_PX) / 2
        painter.setClipRect(QRectF(left, top, right - left, GROOVE_PX))
        painter.fillRect(QRectF(0, top, self.width(), GROOVE_PX), QBrush(colour, HATCHING))
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(colour)
        for low, high in self._stretches:
            start, end = (
                (0.0 if low == 0 else track_x(low, self.width())),
                (self.width() if high == 1 else track_x(high, self.width())),
            )
            painter.drawRoundedRect(QRectF(start, top, end - start, GROOVE_PX), GROOVE_PX / 2, GROOVE_PX / 2)
        painter.restore()

    def set_colours(self, theme: Theme, colour: str) -> None:
        """Paint the filled part in the covariate's colour."""
        half = HANDLE_PX // 2
        self._rest, self._filled = QColor(theme.line), QColor(colour)
        self.setStyleSheet(f"""
            QSlider {{ min-height: {HANDLE_PX + 4}px; }}
            QSlider::groove:horizontal {{ height: {GROOVE_PX}px; background: transparent; }}
            QSlider::handle:horizontal {{ background: {theme.raised}; border: 2px solid {colour};
                width: {HANDLE_PX - 4}px; height: {HANDLE_PX - 4}px; margin: -{half - 2}px 0;
                border-radius: {half}px; }}
            QSlider::handle:horizontal:hover, QSlider::handle:horizontal:focus {{ background: {colour}; }}
        """)
