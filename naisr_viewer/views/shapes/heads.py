"""What stands at the ends of columns and rows, beside the shapes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from PySide6.QtCore import QMargins, QPointF, QRect, QRectF, QSize, Qt
from PySide6.QtGui import QFontMetrics, QPainter, QPaintEvent
from PySide6.QtWidgets import QWidget

from naisr_viewer.state.layouts import Panel
from naisr_viewer.views.elided import shortened
from naisr_viewer.words.matrix import Heads

HEAD_PX = 26
GAP_PX = 4

MARGINS = QMargins(HEAD_PX, HEAD_PX, 0, 0)
"""What heads take of the room for shapes."""

Span = tuple[int, int]
"""From and to, in pixels along a band."""


class Band(QWidget):
    """Words in a line, each in the middle of its span; along the left side they are read from below.

    Args:
        orientation: along the upper side or along the left one.
        parent: the widget around it.
    """

    def __init__(self, orientation: Qt.Orientation, parent: QWidget) -> None:
        super().__init__(parent)
        self.setObjectName("heads")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self._orientation = orientation
        self._words: list[tuple[str, Span]] = []
        self.hide()

    def show_words(self, words: Sequence[tuple[str, Span]]) -> None:
        """Show words at their spans, and no others."""
        self._words = list(words)
        self.setAccessibleName(", ".join(text for text, _ in words))
        self.setToolTip("\n".join(text for text, (start, end) in words if self._is_cut(text, end - start)))
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        """The words."""
        super().paintEvent(event)
        painter = QPainter(self)
        thick = self.height() if self._orientation is Qt.Orientation.Horizontal else self.width()
        for text, (start, end) in self._words:
            painter.save()
            if self._orientation is Qt.Orientation.Vertical:
                painter.translate(QPointF(0, start + end))
                painter.rotate(-90)
            words = shortened(text, self._metrics, end - start - 2 * GAP_PX)
            painter.drawText(QRectF(start, 0, end - start, thick), Qt.AlignmentFlag.AlignCenter, words)
            painter.restore()
        painter.end()

    @property
    def _metrics(self) -> QFontMetrics:
        return QFontMetrics(self.font())

    def _is_cut(self, text: str, length: int) -> bool:
        return self._metrics.horizontalAdvance(text) > length - 2 * GAP_PX


class HeadBands:
    """The words above the columns and those beside the rows.

    Args:
        parent: the widget that the shapes stand on.
    """

    def __init__(self, parent: QWidget) -> None:
        self._above = Band(Qt.Orientation.Horizontal, parent)
        self._beside = Band(Qt.Orientation.Vertical, parent)

    def place(self, heads: Heads | None, areas: Mapping[Panel, QRect], room: QSize) -> None:
        """Put heads where the cells on screen are; None hides them.

        Args:
            heads: the words.
            areas: of the cells on screen (px).
            room: size of the canvas.
        """
        if heads is not None:
            self._above.setGeometry(0, 0, room.width(), HEAD_PX)
            self._beside.setGeometry(0, HEAD_PX, HEAD_PX, room.height() - HEAD_PX)
            cells = {panel.cell: area for panel, area in areas.items() if panel.cell is not None}
            columns = {cell[0]: (area.left(), area.right() + 1) for cell, area in cells.items()}
            rows = {
                cell[1]: (area.top() - HEAD_PX, area.bottom() + 1 - HEAD_PX) for cell, area in cells.items()
            }
            self._above.show_words([(heads.across[each], span) for each, span in columns.items()])
            self._beside.show_words([(heads.down[each], span) for each, span in rows.items()])
        for band in (self._above, self._beside):
            band.setVisible(heads is not None)
            band.raise_()
