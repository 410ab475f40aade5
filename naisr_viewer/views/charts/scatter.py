"""The people behind an atlas over two of its covariates, and where among them the shapes on screen are."""

from __future__ import annotations

import contourpy
import numpy as np
import pyqtgraph
from numpy.typing import NDArray
from PySide6.QtCore import QRect, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPen
from PySide6.QtWidgets import QGraphicsEllipseItem, QWidget

from naisr_model.covariates import Covariate
from naisr_viewer.state.support import Line, Mark, Remoteness, Visits
from naisr_viewer.views.charts.draggable import GOLDEN, STREWN, DraggableChart, Place, extent
from naisr_viewer.views.elided import shortened
from naisr_viewer.views.theme import Theme

RING_PX = 6.5
GRASP_PX = 12.0
DOT_PX, TRIANGLE_PX = 4, 11
DOT_ALPHA, THREAD_ALPHA = 110, 90
MARGIN = 0.04
LEVEL_PX = 42


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


class Scatter(DraggableChart):
    """Dots for people, a line where the data end, triangles for patients, a ring for what is on screen.

    Args:
        parent: the widget around it.
    """

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent, GRASP_PX, LEVEL_PX)
        self.setAccessibleName("Data behind the atlas")
        self._colours = dict[int, str]()
        self._visits: Visits | None = None
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

    def show_visits(self, covariates: tuple[Covariate, Covariate], visits: Visits) -> None:
        """Show the people behind an atlas over two covariates."""
        self._covariates, self._visits = covariates, visits
        self.setXRange(*extent(covariates[0], MARGIN), padding=0)
        self.setYRange(*extent(covariates[1], MARGIN), padding=0)
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

    def _put_mark(self, place: Place) -> None:
        self._ring.setPos(*place)

    def set_theme(self, theme: Theme) -> None:
        """Follow the theme."""
        super().set_theme(theme)
        dot, thread = QColor(theme.muted), QColor(theme.muted)
        dot.setAlpha(DOT_ALPHA)
        thread.setAlpha(THREAD_ALPHA)
        self._dots.setBrush(dot)
        self._threads.setPen(pyqtgraph.mkPen(thread, width=1))
        self._edge.setPen(pyqtgraph.mkPen(theme.muted, width=1.2))
        self._ring.setPen(QPen(QColor(theme.accent), 2.5))

    def drawForeground(self, painter: QPainter, rect: QRectF | QRect) -> None:
        """The units at the far ends of the axes."""
        super().drawForeground(painter, rect)
        if not self._covariates:
            return
        room = self.plotItem.vb.sceneBoundingRect().adjusted(5, 2, -5, -2)
        painter.setPen(QColor(self._theme.muted))
        ends = (Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignBottom, Qt.AlignmentFlag.AlignLeft)
        for covariate, end in zip(self._covariates, ends, strict=True):
            painter.drawText(
                room, end, shortened(covariate.unit, self.fontMetrics(), round(room.width() / 2))
            )
