"""What stands around a shape: its title, its colour bar and its caption."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from PySide6.QtCore import QRect, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent
from PySide6.QtWidgets import QLabel, QWidget

from naisr_viewer.panels.kinds import kind_of, title_of
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.layouts import Panel
from naisr_viewer.state.requests import SurfaceResult
from naisr_viewer.views.colours import panel_colour
from naisr_viewer.views.elided import ElidedLabel
from naisr_viewer.views.shapes.arrangement import CELL_STRIPS, Strips
from naisr_viewer.views.shapes.colour_bar import HEIGHT_PX, WIDTH_PX, ColourBar
from naisr_viewer.words.captions import small

MARGIN_PX = 10
DOT_PX = 10

ROOMY_PX = 116
"""A caption that is narrower has small letters; four words in usual ones are hardly wider."""


def strips_of(panels: Sequence[Panel]) -> Strips:
    """What stands around every shape; colour bars only where a panel has one."""
    if any(panel.cell for panel in panels):
        return CELL_STRIPS
    return Strips(bar=HEIGHT_PX if any(kind_of(panel).scale for panel in panels) else 0)


def columns_of(panels: Sequence[Panel]) -> int:
    """How many sub-plots stand in a row, where they are cells of the matrix; 0 where they are not."""
    return max((panel.cell[0] + 1 for panel in panels if panel.cell is not None), default=0)


class Title(ElidedLabel):
    """A dot in the colour of a surface, and what it is.

    Args:
        text: what stands there.
        colour: of the dot, ``#rrggbb``.
        parent: the widget around it.
    """

    def __init__(self, text: str, colour: str, parent: QWidget) -> None:
        super().__init__(text, parent)
        self._colour = QColor(colour)
        self.setObjectName("panelTitle")
        self.keep_free(MARGIN_PX + 2 * DOT_PX, MARGIN_PX)

    def paintEvent(self, event: QPaintEvent) -> None:
        """The dot before the words."""
        super().paintEvent(event)
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(self._colour)
        painter.drawEllipse(QRectF(MARGIN_PX, (self.height() - DOT_PX) / 2, DOT_PX, DOT_PX))
        painter.end()


@dataclass(eq=False)
class Cell:
    """One sub-plot on screen.

    Attributes:
        title: what stands above.
        caption: the label beneath.
        bar: what its colours stand for; None where it has none.
        words: what the caption says.
        result: the surface, or None as long as there is none.
    """

    title: Title
    caption: QLabel
    bar: ColourBar | None
    words: str = ""
    result: SurfaceResult | None = None

    @property
    def has_surface(self) -> bool:
        """Whether there is anything to see."""
        return self.result is not None and len(self.result.points_mm) > 0

    @property
    def widgets(self) -> list[QWidget]:
        """All that stands around the shape."""
        return [self.title, self.caption, *([] if self.bar is None else [self.bar])]

    def place(self, area: QRect, strips: Strips) -> None:
        """The title above the shape; beneath it the colour bar, and the caption under that.

        Words that need more lines than usual begin higher up.
        """
        self.title.setGeometry(area.left(), area.top(), area.width(), strips.title)
        self.caption.setContentsMargins(0, strips.bar, 0, 0)
        self.caption.setText(self.words if area.width() >= ROOMY_PX else small(self.words))
        height = max(strips.caption + strips.bar, self.caption.heightForWidth(area.width()))
        top = area.top() + max(area.height() - height, strips.title)
        self.caption.setGeometry(area.left(), top, area.width(), area.bottom() + 1 - top)
        if self.bar is not None:
            width = min(WIDTH_PX, area.width())
            self.bar.setGeometry(area.left() + (area.width() - width) // 2, top, width, HEIGHT_PX)


def make_cell(panel: Panel, atlas: AtlasCard, parent: QWidget) -> Cell:
    """The labels of a sub-plot, still without a place, and its colour bar where it has one."""
    title = Title(title_of(panel), panel_colour(atlas, panel), parent)
    title.set_hint(kind_of(panel).hint)
    title.setWhatsThis(kind_of(panel).hint)
    caption = QLabel(parent)
    caption.setObjectName("caption")
    caption.setWordWrap(True)
    caption.setAlignment(Qt.AlignmentFlag.AlignHCenter | Qt.AlignmentFlag.AlignTop)
    scale = kind_of(panel).scale
    bar = None if scale is None else ColourBar(scale, kind_of(panel).unit, parent)
    if bar is not None:
        bar.setToolTip(kind_of(panel).hint)
    return Cell(title, caption, bar)
