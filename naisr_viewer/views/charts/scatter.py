"""The people behind an atlas over two of its covariates, and where among them the shapes on screen are."""

from __future__ import annotations

import contourpy
import numpy as np
import pyqtgraph
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRect, QRectF, Qt, QTimer, Signal
from PySide6.QtGui import QColor, QKeyEvent, QMouseEvent, QPainter, QPen
from PySide6.QtWidgets import QGraphicsEllipseItem, QWidget

from naisr_model.covariates import Covariate
from naisr_viewer.state.support import Line, Mark, Remoteness, Visits
from naisr_viewer.views.charts.chart import Chart
from naisr_viewer.views.elided import shortened
from naisr_viewer.views.theme import LIGHT, Theme

RING_PX = 6.5
GRASP_PX = 12.0
"""Who presses so near to the ring takes hold of it; elsewhere it comes to where is pressed."""

DOT_PX, TRIANGLE_PX = 4, 11
DOT_ALPHA, THREAD_ALPHA = 110, 90
STREWN = 0.22
"""Half of the width over which people of one level of a binary covariate are strewn."""

GOLDEN = (5**0.5 - 1) / 2
"""Multiples of it, without what is before the point, lie evenly between 0 and 1."""

MARGIN = 0.04
BEYOND_LEVELS = 1.6
LEVEL_PX = 42
"""Longer names of levels are shortened."""

SETTLE_MS = 400
"""Keys count as one movement until they pause this long."""

STEPS = {
    Qt.Key.Key_Left: (-1, 0),
    Qt.Key.Key_Right: (1, 0),
    Qt.Key.Key_Down: (0, -1),
    Qt.Key.Key_Up: (0, 1),
}
KEY_STEPS = 100
"""Key presses from one end of a continuous covariate to the other."""


def edges(remoteness: Remoteness) -> list[Line]:
    """The lines at which the data end."""
    generator = contourpy.contour_generator(remoteness.x, remoteness.y, remoteness.values)
    return [np.asarray(line) for line in generator.lines(1.0)]


def strewn(places: Line, subjects: NDArray[np.intp], covariates: tuple[Covariate, Covariate]) -> Line:
    """``places`` of which those at the level of a binary covariate do not hide each other.

    All visits of a subject are shifted alike.
    """
    shift = STREWN * (2 * np.modf(subjects * GOLDEN)[0] - 1)
    shifts = [shift if covariate.kind == "binary" else np.zeros(len(places)) for covariate in covariates]
    return places + np.stack(shifts, axis=1)


def chosen(covariate: Covariate, value: float) -> float:
    """The value that is taken where the ring is: as round as it is shown, the ends exactly."""
    low, high = covariate.range
    return min(max(round(min(max(value, low), high), covariate.decimals), low), high)


def key_step(covariate: Covariate) -> float:
    """How far a key press moves: from level to level of a binary covariate, with the middle between them."""
    low, high = covariate.range
    return 1.0 if covariate.kind == "binary" else (high - low) / KEY_STEPS


class Scatter(Chart):
    """Dots for people, a line where the data end, triangles for patients, a ring for what is on screen.

    Args:
        parent: the widget around it.
    """

    place_moved = Signal(float, float)  # real values along and upwards: the ring is on its way
    place_settled = Signal(float, float)  # the same: it came to rest

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setAccessibleName("Data behind the atlas")
        self._theme, self._colours = LIGHT, dict[int, str]()
        self._covariates: tuple[Covariate, Covariate] | None = None
        self._visits: Visits | None = None
        self._place, self._grasp = QPointF(), QPointF()
        self._is_held = False
        self._pending: tuple[float, float] | None = None
        self._threads = pyqtgraph.PlotCurveItem(antialias=True)
        self._dots = pyqtgraph.ScatterPlotItem(size=DOT_PX, pen=None, antialias=True)
        self._edge = pyqtgraph.PlotCurveItem(connect="finite", antialias=True)
        self._outlines: list[pyqtgraph.PlotCurveItem] = []
        self._marks = pyqtgraph.ScatterPlotItem(size=TRIANGLE_PX, symbol="t1", antialias=True)
        self._ring = QGraphicsEllipseItem(QRectF(-RING_PX, -RING_PX, 2 * RING_PX, 2 * RING_PX))
        self._ring.setFlag(QGraphicsEllipseItem.GraphicsItemFlag.ItemIgnoresTransformations)
        for depth, item in enumerate((self._threads, self._dots, self._edge, self._marks, self._ring)):
            item.setZValue(10 * depth)
            self.plotItem.vb.addItem(item, ignoreBounds=True)
        self._settle = QTimer(self, singleShot=True, interval=SETTLE_MS)
        self._settle.timeout.connect(self._settled)

    def show_visits(self, covariates: tuple[Covariate, Covariate], visits: Visits) -> None:
        """Show the people behind an atlas over two covariates."""
        self._covariates, self._visits = covariates, visits
        self.setXRange(*_extent(covariates[0]), padding=0)
        self.setYRange(*_extent(covariates[1]), padding=0)
        for side, covariate in zip(("bottom", "left"), covariates, strict=True):
            self.plotItem.getAxis(side).setTicks(self._ticks(covariate))
        places = strewn(visits.places, visits.subjects, covariates)
        is_joined = np.append(visits.subjects[1:] == visits.subjects[:-1], False)
        self._dots.setData(*places.T)
        self._threads.setData(*places.T, connect=is_joined.astype(np.int32))

    def show_edge(self, remoteness: Remoteness) -> None:
        """Draw the line at which the data end."""
        gap = np.full((1, 2), np.nan)
        lines = np.concatenate([gap, *(part for line in edges(remoteness) for part in (line, gap))])
        self._edge.setData(*lines.T)

    def show_marks(self, marks: tuple[Mark, ...], colours: dict[int, str]) -> None:
        """Show patients in their colours, and around where they are with 95 %."""
        for item in self._outlines:
            self.plotItem.vb.removeItem(item)
        self._outlines = [
            pyqtgraph.PlotCurveItem(
                *line.T, pen=pyqtgraph.mkPen(colours[mark.key], width=1.5), antialias=True
            )
            for mark in marks
            for line in mark.outlines
        ]
        for item in self._outlines:
            item.setZValue(25)
            self.plotItem.vb.addItem(item, ignoreBounds=True)
        self._colours = colours
        self._marks.setData(
            [{"pos": mark.place, "brush": colours[mark.key], "pen": self._theme.raised} for mark in marks]
        )

    def show_place(self, x: float, y: float) -> None:
        """Put the ring at the real values of what is on screen, without telling anybody."""
        self._place = QPointF(x, y)
        self._ring.setPos(self._place)

    def set_theme(self, theme: Theme) -> None:
        """Follow the theme."""
        super().set_theme(theme)
        self._theme = theme
        dot, thread = QColor(theme.muted), QColor(theme.muted)
        dot.setAlpha(DOT_ALPHA)
        thread.setAlpha(THREAD_ALPHA)
        self._dots.setBrush(dot)
        self._threads.setPen(pyqtgraph.mkPen(thread, width=1))
        self._edge.setPen(pyqtgraph.mkPen(theme.muted, width=1.2))
        self._ring.setPen(QPen(QColor(theme.accent), 2.5))

    def forget_move(self) -> None:
        """Say no more of a movement that has not come to rest."""
        self._settle.stop()
        self._is_held, self._pending = False, None

    def place_of(self, x: float, y: float) -> QPointF:
        """Where real values are, in pixels of the widget."""
        return QPointF(self.mapFromScene(self.plotItem.vb.mapViewToScene(QPointF(x, y))))

    def drawForeground(self, painter: QPainter, rect: QRectF | QRect) -> None:
        """The units at the far ends of the axes."""
        super().drawForeground(painter, rect)
        if self._covariates is None:
            return
        room = self.plotItem.vb.sceneBoundingRect().adjusted(5, 2, -5, -2)
        painter.setPen(QColor(self._theme.muted))
        ends = (Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignBottom, Qt.AlignmentFlag.AlignLeft)
        for covariate, end in zip(self._covariates, ends, strict=True):
            painter.drawText(
                room, end, shortened(covariate.unit, self.fontMetrics(), round(room.width() / 2))
            )

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Take hold of the ring, or have it come."""
        scene = self.mapToScene(event.position().toPoint())
        if event.button() != Qt.MouseButton.LeftButton or self._covariates is None:
            return
        if not self.plotItem.vb.sceneBoundingRect().contains(scene):
            return
        away = self.place_of(self._place.x(), self._place.y()) - event.position()
        is_near = QPointF.dotProduct(away, away) <= GRASP_PX**2
        self._is_held, self._grasp = True, away if is_near else QPointF()
        if not is_near:
            self._go_to(event.position())

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Take the ring along."""
        if self._is_held:
            self._go_to(event.position() + self._grasp)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """Let go of it."""
        if event.button() == Qt.MouseButton.LeftButton and self._is_held:
            self._is_held = False
            self._settled()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Arrows move the ring."""
        if event.key() not in STEPS or self._covariates is None:
            event.ignore()
            return
        steps, here = STEPS[Qt.Key(event.key())], (self._place.x(), self._place.y())
        goal = [
            value + step * key_step(covariate)
            for value, step, covariate in zip(here, steps, self._covariates, strict=True)
        ]
        self._move(*goal)
        self._settle.start()

    def _go_to(self, position: QPointF) -> None:
        real = self.plotItem.vb.mapSceneToView(self.mapToScene(position.toPoint()))
        self._settle.stop()
        self._move(real.x(), real.y())

    def _move(self, x: float, y: float) -> None:
        assert self._covariates is not None
        along, upwards = self._covariates
        goal = chosen(along, x), chosen(upwards, y)
        if goal != (self._place.x(), self._place.y()):
            self._pending = goal
            self.place_moved.emit(*goal)

    def _settled(self) -> None:
        self._settle.stop()
        if self._pending is not None:
            place, self._pending = self._pending, None
            self.place_settled.emit(*place)

    def _ticks(self, covariate: Covariate) -> list[list[tuple[float, str]]] | None:
        """Levels by their names; None leaves numbers to the axis."""
        if covariate.kind == "continuous":
            return None
        names = (shortened(name, self.fontMetrics(), LEVEL_PX) for name in covariate.levels)
        return [list(zip((-1.0, 1.0), names, strict=True))]


def _extent(covariate: Covariate) -> tuple[float, float]:
    """What is seen of an axis."""
    low, high = covariate.range
    if covariate.kind == "binary":
        return -BEYOND_LEVELS, BEYOND_LEVELS
    margin = MARGIN * (high - low)
    return low - margin, high + margin
