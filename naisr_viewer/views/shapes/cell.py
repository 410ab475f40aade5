"""What stands around a shape: its title, its colour bar and its caption."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from PySide6.QtCore import QRect, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent
from PySide6.QtWidgets import QLabel, QWidget

from naisr_viewer.panels.kinds import hint_of, kind_of, title_of, unit_of
from naisr_viewer.panels.scales import PanelScale
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.layouts import Panel
from naisr_viewer.state.requests import Colouring, SurfaceResult
from naisr_viewer.state.section import Cut
from naisr_viewer.views.colours import panel_colour
from naisr_viewer.views.elided import ElidedLabel
from naisr_viewer.views.shapes.arrangement import CELL_STRIPS, Strips
from naisr_viewer.views.shapes.colour_bar import WIDTH_PX, ColourBar
from naisr_viewer.views.shapes.compass import SIZE_PX, Compass
from naisr_viewer.words.captions import small
from naisr_viewer.words.section import area as area_of

MARGIN_PX = 10
DOT_PX = 10

COMPASS_WIDE, COMPASS_HIGH, COMPASS_GAP_PX = 0.4, 0.65, 4
"""Of the width and height of a shape's room the compass takes no more; how far it is from its corner (px)."""

ROOMY_PX = 116
"""A caption that is narrower has small letters; four words in usual ones are hardly wider."""


def strips_of(cells: Mapping[Panel, Cell]) -> Strips:
    """What stands around every shape; colour bars only where one has its colours explained."""
    if columns_of(cells):
        return CELL_STRIPS
    bars = (cell.bar.sizeHint().height() for cell in cells.values() if cell.bar and cell.scale)
    return Strips(bar=max(bars, default=0))


def columns_of(panels: Iterable[Panel]) -> int:
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
        bar: what its colours stand for; None where it never has any.
        compass: which way the body lies; None in the plane.
        words: what the caption says.
        scale: of its colours; None where it has none now.
        result: the surface, or None as long as there is none.
        has_room: whether the compass does not hide the shape.
        cut: where the section plane cuts it; None without one.
    """

    title: Title
    caption: QLabel
    bar: ColourBar | None
    compass: Compass | None
    words: str = ""
    scale: PanelScale | None = None
    result: SurfaceResult | None = None
    has_room: bool = False
    cut: Cut | None = None

    @property
    def has_surface(self) -> bool:
        """Whether there is anything to see."""
        return self.result is not None and len(self.result.points_mm) > 0

    @property
    def told(self) -> str:
        """What the caption says, and how large the cut is."""
        cut = "" if self.cut is None or self.result is None else area_of(self.cut)
        return "<br>".join(filter(None, (self.words, cut)))

    @property
    def widgets(self) -> list[QWidget]:
        """All that stands around the shape."""
        return [self.title, self.caption]

    def show_scale(self, scale: PanelScale | None) -> None:
        """Say what the colours stand for; None where there are none."""
        self.scale = scale
        if self.bar is not None and scale is not None:
            self.bar.show_unit(scale.scale, scale.unit)
            if self.colouring is not None:
                self.bar.set_limit(self.colouring.limit)

    @property
    def colouring(self) -> Colouring | None:
        """The colours on the surface, to the end of the scale that was chosen."""
        found = None if self.result is None else self.result.colouring
        if found is None or self.scale is None or self.scale.limit is None:
            return found
        return replace(found, limit=self.scale.limit)

    def show(self, is_seen: bool) -> None:
        """Show all that stands around the shape, or hide it."""
        for widget in self.widgets:
            widget.setVisible(is_seen and widget.height() > 0)
            widget.raise_()
        if self.bar is not None:
            self.bar.setVisible(is_seen and self.scale is not None)
            self.bar.raise_()
        if self.compass is not None:
            self.compass.setVisible(is_seen and self.has_room)
            self.compass.raise_()

    def discard(self) -> None:
        """Take it all away."""
        for widget in (*self.widgets, self.compass, self.bar):
            if widget is not None:
                widget.deleteLater()

    def place(self, area: QRect, strips: Strips) -> None:
        """The title above the shape; beneath it the colour bar, and the caption under that.

        Words that need more lines than usual begin higher up.
        """
        self.title.setGeometry(area.left(), area.top(), area.width(), strips.title)
        self.caption.setContentsMargins(0, strips.bar, 0, 0)
        self.caption.setText(self.told if area.width() >= ROOMY_PX else small(self.told))
        height = max(strips.caption + strips.bar, self.caption.heightForWidth(area.width()))
        top = area.top() + max(area.height() - height, strips.title)
        self.caption.setGeometry(area.left(), top, area.width(), area.bottom() + 1 - top)
        wide, high = COMPASS_WIDE * area.width(), COMPASS_HIGH * (top - area.top() - strips.title)
        self.has_room = min(wide, high) >= SIZE_PX
        if self.compass is not None:
            self.compass.move(area.left() + COMPASS_GAP_PX, top - SIZE_PX - COMPASS_GAP_PX)
        if self.bar is not None:
            width = min(WIDTH_PX, area.width())
            self.bar.setGeometry(area.left() + (area.width() - width) // 2, top, width, strips.bar)


def make_cell(panel: Panel, atlas: AtlasCard, parent: QWidget) -> Cell:
    """The labels of a sub-plot, still without a place, and its colour bar where it has one."""
    title = Title(title_of(panel), panel_colour(atlas, panel), parent)
    title.set_hint(hint_of(panel, atlas))
    title.setWhatsThis(hint_of(panel, atlas))
    caption = QLabel(parent)
    caption.setObjectName("caption")
    caption.setWordWrap(True)
    caption.setAlignment(Qt.AlignmentFlag.AlignHCenter | Qt.AlignmentFlag.AlignTop)
    kind = kind_of(panel)
    bar = (
        ColourBar(kind.scale or "signed", unit_of(panel, atlas), parent)
        if kind.scale or kind.is_mapped
        else None
    )
    if bar is not None:
        bar.setToolTip(hint_of(panel, atlas))
    return Cell(title, caption, bar, None if atlas.is_flat else Compass(parent))
