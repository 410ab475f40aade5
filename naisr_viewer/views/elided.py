"""Words of any length on one line."""

from __future__ import annotations

from PySide6.QtCore import QRect, QRectF, QSize, Qt
from PySide6.QtGui import QFontMetrics, QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import QCheckBox, QLabel, QSizePolicy, QStyle, QStyleOptionButton, QWidget

from naisr_viewer.words.titles import as_entry, as_tip

LEAST_PX = 24
"""No label asks for more."""

BOX_PX = 36
"""Of a tick box, with its first letters."""

UNIT_PX = 84
"""A unit is never wider."""


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
        self._left_px = self._right_px = 0
        self.setText(text)

    def setText(self, text: str) -> None:
        """Say something else."""
        super().setText(text)
        self._explain()

    def set_hint(self, hint: str) -> None:
        """What else is told on hover."""
        self._hint = hint
        self._explain()

    def keep_free(self, left_px: int, right_px: int) -> None:
        """Leave room at both ends; a style sheet takes a label's own margins away."""
        self._left_px, self._right_px = left_px, right_px
        self._explain()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """There may be room for more now."""
        super().resizeEvent(event)
        self._explain()

    def minimumSizeHint(self) -> QSize:
        """Room for a letter or two; the rest is told on hover."""
        hint = super().minimumSizeHint()
        return QSize(min(hint.width(), LEAST_PX), hint.height())

    def paintEvent(self, _event: QPaintEvent) -> None:
        """As much of the text as there is room for."""
        painter = QPainter(self)
        room = self._room
        painter.drawText(room, self.alignment(), shortened(self.text(), self.fontMetrics(), room.width()))
        painter.end()

    @property
    def _room(self) -> QRect:
        return self.rect().adjusted(self._left_px, 0, -self._right_px, 0)

    def _explain(self) -> None:
        is_whole = self.fontMetrics().horizontalAdvance(self.text()) <= self._room.width()
        self.setToolTip(as_tip("\n".join(filter(None, ("" if is_whole else self.text(), self._hint)))))


class ElidedCheckBox(QCheckBox):
    """A tick box whose words are shortened in their middle where they do not fit.

    Args:
        text: what it says.
        hint: what ticking it does.
        parent: the widget around it.
    """

    def __init__(self, text: str, hint: str, parent: QWidget) -> None:
        super().__init__(as_entry(text), parent)
        self._text, self._hint = text, hint
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.setMinimumWidth(BOX_PX)
        self.setToolTip(as_tip(hint))

    def paintEvent(self, event: QPaintEvent) -> None:
        """With a frame around the tick, which the style draws darker than any dark ground."""
        super().paintEvent(event)
        option = QStyleOptionButton()
        self.initStyleOption(option)
        box = self.style().subElementRect(QStyle.SubElement.SE_CheckBoxIndicator, option, self)
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(self.palette().placeholderText().color())
        painter.drawRoundedRect(QRectF(box).adjusted(0.5, 0.5, -0.5, -0.5), 2.0, 2.0)
        painter.end()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """There may be room for more now, or for less."""
        super().resizeEvent(event)
        box = self.style().pixelMetric(QStyle.PixelMetric.PM_IndicatorWidth, None, self)
        gap = self.style().pixelMetric(QStyle.PixelMetric.PM_CheckBoxLabelSpacing, None, self)
        seen = shortened(self._text, self.fontMetrics(), self.width() - box - gap - 6)
        self.setText(as_entry(seen))
        self.setToolTip(as_tip(self._hint if seen == self._text else f"{self._text}\n{self._hint}"))


def unit_label(unit: str, parent: QWidget) -> ElidedLabel:
    """The unit behind a number: as wide as it is, up to :data:`UNIT_PX`."""
    label = ElidedLabel(unit, parent)
    label.setObjectName("muted")
    label.setSizePolicy(QSizePolicy.Policy.Maximum, QSizePolicy.Policy.Preferred)
    label.setMaximumWidth(UNIT_PX)
    return label
