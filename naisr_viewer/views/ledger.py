"""The drawer's page Point: what moved each pinned place from the template to where it is."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QResizeEvent
from PySide6.QtWidgets import QHBoxLayout, QLabel, QScrollArea, QSizePolicy, QToolButton, QWidget

from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.pins import Entry, Ledger, Part, Pin
from naisr_viewer.views.colours import covariate_colour, pin_colour
from naisr_viewer.views.elided import shortened
from naisr_viewer.views.theme import LIGHT, Theme
from naisr_viewer.words import ledger as words
from naisr_viewer.words.numbers import MILLIMETRES, way
from naisr_viewer.words.titles import as_tip

TITLE_PX, LINE_PX = 24, 20
NAME_PX, ALONG_PX, GAP_PX = 96, 118, 6
"""Most of a name, what is along the surface where there is room for it, and what is left free between."""

LEAST_BAR_PX = 48
WIDEST_PX = 620
"""Of one place; longer bars would say no more."""

DOT_PX = 10
PALE = 0.35
"""Opacity of a bar that is not told from nothing."""

LEAST_SCALE_MM = 0.5
"""Bars of less than that are not blown up to the whole width."""


@dataclass(frozen=True)
class Ink:
    """What a chart is painted with.

    Attributes:
        theme: of the window.
        causes: colour of each covariate, by name.
        unit: of length.
    """

    theme: Theme = LIGHT
    causes: tuple[tuple[str, str], ...] = ()
    unit: str = MILLIMETRES

    def of(self, part: Part) -> QColor:
        """The colour of a part; grey of what no covariate did."""
        colour = QColor(dict(self.causes).get(part.cause, self.theme.muted))
        colour.setAlphaF(1.0 if part.is_told else PALE)
        return colour


class EntryChart(QWidget):
    """Signed bars of one pinned place.

    Args:
        pin: which.
        parent: the widget around it.
    """

    def __init__(self, pin: Pin, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._pin = pin
        self._entry: Entry | None = None
        self._scale_mm, self._ink = LEAST_SCALE_MM, Ink()
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setMaximumWidth(WIDEST_PX)
        self.remove = QToolButton(self, autoRaise=True)
        self.remove.setText("×")
        self.remove.setFixedSize(TITLE_PX, TITLE_PX - 2)
        self.remove.setToolTip(f"Remove {words.title(pin.number).lower()}")
        self.remove.setAccessibleName(self.remove.toolTip())

    def show_entry(self, entry: Entry | None, scale_mm: float, ink: Ink) -> None:
        """Show what moved the place; None where it has no place.

        Args:
            entry: what is told.
            scale_mm: what a bar of half the width stands for.
            ink: what it is painted with.
        """
        self._entry, self._scale_mm, self._ink = entry, scale_mm, ink
        text = words.NO_PLACE if entry is None else words.told(entry, ink.unit)
        self.setToolTip(as_tip(f"{text}\n\n{words.HINT}"))
        self.setAccessibleName(text)
        self.updateGeometry()
        self.update()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """The cross stays at the far end of the title."""
        super().resizeEvent(event)
        self.remove.move(self.width() - self.remove.width(), 1)

    def sizeHint(self) -> QSize:
        """A line for each cause."""
        count = 1 if self._entry is None else len(words.lines(self._entry))
        return QSize(2 * NAME_PX + 2 * LEAST_BAR_PX, TITLE_PX + count * LINE_PX)

    def paintEvent(self, _event: QPaintEvent) -> None:
        """The title with the dot that marks the place on the shapes, and a line for each cause."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(pin_colour(self._pin.number)))
        painter.drawEllipse(QRectF(0, (TITLE_PX - DOT_PX) / 2, DOT_PX, DOT_PX))
        self._write(
            painter,
            QRectF(DOT_PX + 6, 0, self.width() - DOT_PX - 2 * TITLE_PX, TITLE_PX),
            words.title(self._pin.number),
        )
        if self._entry is None:
            self._write(painter, QRectF(0, TITLE_PX, self.width(), LINE_PX), words.NO_PLACE, muted=True)
        else:
            self._paint_lines(painter, words.lines(self._entry))
        painter.end()

    def _paint_lines(self, painter: QPainter, lines: Sequence[tuple[str, Part]]) -> None:
        """A line each; how sure a figure is gives way where bars would be too short: the tip has it."""
        names, parts = zip(*lines, strict=True)
        name_px = min(NAME_PX, self._widest(names))
        room = self.width() - name_px - 2 * LEAST_BAR_PX
        figures = [words.across(part, self._ink.unit) for part in parts]
        if self._widest(figures) > room:
            figures = [way(part.normal_mm, self._ink.unit) for part in parts]
        figure_px = self._widest(figures)
        along_px = ALONG_PX if figure_px + ALONG_PX <= room else 0
        right = self.width() - figure_px - along_px
        end = Qt.AlignmentFlag.AlignRight
        for row, (name, part, figure) in enumerate(zip(names, parts, figures, strict=True)):
            top = TITLE_PX + row * LINE_PX
            self._write(painter, QRectF(0, top, name_px - GAP_PX, LINE_PX), name)
            self._paint_bar(painter, QRectF(name_px, top, right - name_px - GAP_PX, LINE_PX), part)
            self._write(painter, QRectF(right, top, figure_px, LINE_PX), figure, side=end)
            if along_px:
                box = QRectF(right + figure_px, top, along_px, LINE_PX)
                self._write(painter, box, words.along(part, self._ink.unit), muted=True, side=end)

    def _widest(self, texts: Iterable[str]) -> int:
        """Room for each of some texts, and the gap beside it."""
        return max(map(self.fontMetrics().horizontalAdvance, texts)) + GAP_PX

    def _paint_bar(self, painter: QPainter, box: QRectF, part: Part) -> None:
        middle, half = box.center().x(), box.width() / 2

        def place(mm: float) -> float:
            return middle + half * max(-1.0, min(1.0, mm / (self._scale_mm or 1.0)))

        bar = QRectF(middle, box.top() + 5, place(part.normal_mm) - middle, box.height() - 10)
        painter.fillRect(bar.normalized(), self._ink.of(part))
        painter.setPen(QPen(QColor(self._ink.theme.muted), 1.0))
        painter.drawLine(QPointF(middle, box.top() + 2), QPointF(middle, box.bottom() - 2))
        if part.margin_mm is not None:
            painter.setPen(QPen(QColor(self._ink.theme.text), 1.5))
            low, high = (place(part.normal_mm + side * part.margin_mm) for side in (-1, 1))
            painter.drawLine(QPointF(low, box.center().y()), QPointF(high, box.center().y()))

    def _write(
        self,
        painter: QPainter,
        box: QRectF,
        text: str,
        muted: bool = False,
        side: Qt.AlignmentFlag = Qt.AlignmentFlag.AlignLeft,
    ) -> None:
        painter.setPen(QColor(self._ink.theme.muted if muted else self._ink.theme.text))
        seen = shortened(text, self.fontMetrics(), round(box.width()))
        painter.drawText(box, side | Qt.AlignmentFlag.AlignVCenter, seen)


class LedgerPage(QScrollArea):
    """The pinned places beside one another, or how to pin one."""

    removal_requested = Signal(int)  # number of a pin

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._theme = LIGHT
        self._atlas: AtlasCard | None = None
        self._ledger: Ledger | None = None
        self.charts: dict[Pin, EntryChart] = {}
        self.setWidgetResizable(True)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        inside = QWidget(self)
        self._row = QHBoxLayout(inside)
        self._row.setContentsMargins(14, 2, 14, 4)
        self._row.setSpacing(28)
        self._row.setAlignment(Qt.AlignmentFlag.AlignTop)
        self._invitation = QLabel(words.INVITATION, self)
        self._invitation.setObjectName("muted")
        self._invitation.setWordWrap(True)
        self._row.addWidget(self._invitation)
        self.setWidget(inside)

    def show_ledger(self, ledger: Ledger | None, atlas: AtlasCard | None) -> None:
        """Show what moved the pinned places; None where there are none."""
        self._ledger, self._atlas = ledger, atlas
        pins = () if ledger is None else ledger.request.pins
        if tuple(self.charts) != pins:
            self._make_charts(pins)
        self._invitation.setVisible(not pins)
        self._fill()

    def set_theme(self, theme: Theme) -> None:
        """Follow the theme."""
        self._theme = theme
        self._fill()

    def _make_charts(self, pins: tuple[Pin, ...]) -> None:
        for chart in self.charts.values():
            self._row.removeWidget(chart)
            chart.hide()
            chart.deleteLater()
        self.charts = {pin: EntryChart(pin, self) for pin in pins}
        for pin, chart in self.charts.items():
            chart.remove.clicked.connect(lambda _, number=pin.number: self.removal_requested.emit(number))
            self._row.addWidget(chart, 1)

    def _fill(self) -> None:
        if self._ledger is None or self._atlas is None:
            return
        atlas, entries = self._atlas, {entry.pin: entry for entry in self._ledger.entries}
        causes = tuple((one.name, covariate_colour(atlas, one.name)) for one in atlas.covariates)
        ink = Ink(self._theme, causes, atlas.frame.unit)
        least = LEAST_SCALE_MM if ink.unit == MILLIMETRES else 0.0
        parts = [part for entry in entries.values() for _, part in words.lines(entry)]
        ways = [abs(part.normal_mm) + (part.margin_mm or 0.0) for part in parts]
        for pin, chart in self.charts.items():
            chart.show_entry(entries.get(pin), max([least, *ways]), ink)
