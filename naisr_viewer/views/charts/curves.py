"""A measure along a covariate, and a line at what is on screen that can be dragged."""

from __future__ import annotations

import numpy as np
import pyqtgraph
from PySide6.QtCore import QBuffer, QIODevice, QPoint, QRect, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter
from PySide6.QtSvg import QSvgGenerator
from PySide6.QtWidgets import QWidget

from naisr_model.covariates import Covariate
from naisr_viewer.state.curves import Curves, MeasureCurve, Numbers
from naisr_viewer.views.charts.draggable import GOLDEN, STREWN, DraggableChart, Place, extent
from naisr_viewer.views.elided import shortened
from naisr_viewer.views.theme import LIGHT, Theme
from naisr_viewer.words import curves as words
from naisr_viewer.words.titles import label

GRASP_PX = 8.0
BAND_ALPHA, SURE_ALPHA, DOT_ALPHA = 46, 95, 95
DOT_PX, SIGHTING_PX = 4, 9
MARGIN = 0.02
LEVEL_PX = 90
TITLE_PX = 18
"""Above the curves, for what the axes are."""

PICTURE = QSize(720, 440)
"""Of an SVG."""


class CurveChart(DraggableChart):
    """The population's curve with its bands, people as dots, a patient, and the line.

    Args:
        parent: the widget around it.
    """

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent, GRASP_PX, LEVEL_PX)
        self.setAccessibleName("Measure along a covariate")
        self.plotItem.setContentsMargins(4, TITLE_PX, 8, 2)
        self._colours = (LIGHT.accent, LIGHT.accent)
        self._curve: MeasureCurve | None = None
        self._is_labelled = False
        self._usual, self._path, self._own = (_line() for _ in range(3))
        self._band, self._sure = (pyqtgraph.FillBetweenItem(_line(), _line()) for _ in range(2))
        self._dots = pyqtgraph.ScatterPlotItem(size=DOT_PX, pen=None, antialias=True)
        self._interval = pyqtgraph.ErrorBarItem(x=np.zeros(0), y=np.zeros(0))
        self._sighting = pyqtgraph.ScatterPlotItem(size=SIGHTING_PX, antialias=True)
        self._here = pyqtgraph.InfiniteLine(movable=False)
        people = (self._band, self._sure, self._dots, self._path, self._usual)
        for depth, item in enumerate((*people, self._own, self._interval, self._sighting, self._here)):
            item.setZValue(10 * depth)
            self.plotItem.vb.addItem(item, ignoreBounds=True)

    def show_curve(
        self, covariate: Covariate, curves: Curves, curve: MeasureCurve, colours: tuple[str, str]
    ) -> None:
        """Show one of the curves.

        Args:
            covariate: along which.
            curves: the answer that it belongs to.
            curve: which.
            colours: of the covariate and of the patient.
        """
        self._covariates, self._curve, self._colours = (covariate,), curve, colours
        lines = {self._usual: curve.usual, self._path: curve.path, self._own: curve.own}
        bands = {self._band: curve.band, self._sure: curve.sure}
        for item, ends in bands.items():
            lines |= dict(zip(item.curves, ends or (None, None), strict=True))
        for item, values in lines.items():
            item.setData(*_drawn(curves.places, values))
        self._dots.setData(*_drawn(_strewn(curves.visits, covariate), curve.observed))
        drawn = bands | {self._path: curve.path, self._own: curve.own}
        for item, known in (drawn | {self._dots: curve.observed}).items():
            item.setVisible(known is not None)
        self._show_sighting(curve)
        self.setXRange(*extent(covariate, MARGIN), padding=0)
        self.setYRange(*_span(curve), padding=0.04)
        self.plotItem.getAxis("bottom").setTicks(self._ticks(covariate))
        self._colour()

    def _put_mark(self, place: Place) -> None:
        self._here.setPos(*place)

    def set_theme(self, theme: Theme) -> None:
        """Follow the theme."""
        super().set_theme(theme)
        self._colour()

    def drawForeground(self, painter: QPainter, rect: QRectF | QRect) -> None:
        """What the axes are: the measure above, the covariate at the far end."""
        super().drawForeground(painter, rect)
        if self._curve is None or self._is_labelled:
            return
        room = self.plotItem.vb.sceneBoundingRect()
        half = round(room.width() / 2)
        box = QRectF(room.left(), room.top() - TITLE_PX, room.width(), TITLE_PX)
        painter.setPen(QColor(self._theme.muted))
        for text, side in (
            (words.axis(self._curve), Qt.AlignmentFlag.AlignLeft),
            (_along(*self._covariates), Qt.AlignmentFlag.AlignRight),
        ):
            seen = shortened(text, self.fontMetrics(), half)
            painter.drawText(box, side | Qt.AlignmentFlag.AlignVCenter, seen)

    def label_axes(self) -> None:
        """Say at the axes themselves what they are, where there is room for that."""
        assert self._curve is not None
        colour = {"color": self._theme.text}
        self.plotItem.setLabel("bottom", _along(*self._covariates), **colour)
        self.plotItem.setLabel("left", words.axis(self._curve), **colour)
        self.plotItem.layout.activate()  # now, not by the next event
        self._dots.opts["useCache"] = self._sighting.opts["useCache"] = False  # as shapes, not as pixels
        self._is_labelled = True

    def _show_sighting(self, curve: MeasureCurve) -> None:
        seen = () if curve.sighting is None else (curve.sighting,)
        x, y = np.array([each.place for each in seen]), np.array([each.value for each in seen])
        self._sighting.setData(x, y)
        for item in (self._sighting, self._interval):
            item.setVisible(bool(seen))
        self._interval.setData(x=x, y=y, height=2 * np.array([each.margin or 0.0 for each in seen]))

    def _colour(self) -> None:
        covariate, patient = map(QColor, self._colours)
        band, sure, dot = QColor(covariate), QColor(covariate), QColor(self._theme.muted)
        for colour, alpha in ((band, BAND_ALPHA), (sure, SURE_ALPHA), (dot, DOT_ALPHA)):
            colour.setAlpha(alpha)
        self._band.setBrush(band)
        self._sure.setBrush(sure)
        self._dots.setBrush(dot)
        self._usual.setPen(pyqtgraph.mkPen(covariate, width=2))
        self._path.setPen(pyqtgraph.mkPen(covariate, width=1.5, style=Qt.PenStyle.DashLine))
        self._own.setPen(pyqtgraph.mkPen(patient, width=2))
        self._interval.setData(pen=pyqtgraph.mkPen(patient, width=2))
        self._sighting.setBrush(patient)
        self._sighting.setPen(pyqtgraph.mkPen(self._theme.raised))
        self._here.setPen(pyqtgraph.mkPen(self._theme.accent, width=1.5))


def picture(chart: CurveChart) -> bytes:
    """What a chart shows as SVG, with its axes told; the chart is of no use afterwards."""
    chart.setAttribute(Qt.WidgetAttribute.WA_DontShowOnScreen)
    chart.show()  # else it does not learn its size
    chart.resize(PICTURE)
    chart.label_axes()
    buffer, generator = QBuffer(), QSvgGenerator()
    buffer.open(QIODevice.OpenModeFlag.WriteOnly)
    generator.setOutputDevice(buffer)
    generator.setSize(PICTURE)
    generator.setResolution(chart.logicalDpiX())  # axes are drawn as they would be on that
    generator.setViewBox(QRect(QPoint(), PICTURE))
    painter = QPainter(generator)
    chart.render(painter)
    painter.end()
    return bytes(buffer.data().data())


def _along(covariate: Covariate) -> str:
    """What stands at the axis of a covariate."""
    return label(covariate.name) + (f", {covariate.unit}" if covariate.unit else "")


def _line() -> pyqtgraph.PlotCurveItem:
    return pyqtgraph.PlotCurveItem(antialias=True)


def _drawn(places: Numbers, values: Numbers | None) -> tuple[Numbers, Numbers]:
    """What an item is given; nothing where there are no values."""
    return (np.zeros(0), np.zeros(0)) if values is None else (places, values)


def _strewn(visits: Numbers, covariate: Covariate) -> Numbers:
    """Visits of which those at one level do not hide each other."""
    shift = STREWN * (2 * np.modf(np.arange(len(visits)) * GOLDEN)[0] - 1)
    return visits + shift if covariate.kind == "binary" else visits


def _span(curve: MeasureCurve) -> tuple[float, float]:
    """All that is to be seen of a measure."""
    parts = [curve.usual, curve.path, curve.observed, curve.own, *(curve.band or ()), *(curve.sure or ())]
    if (seen := curve.sighting) is not None:
        parts.append(seen.value + np.array([-1.0, 1.0]) * (seen.margin or 0.0))
    numbers = np.concatenate([part for part in parts if part is not None])
    return float(numbers.min()), float(numbers.max())
