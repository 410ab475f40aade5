"""Where there are data: the population beneath a slider."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from naisr_model.covariates import Covariate
from naisr_viewer.views.covariates.slider import HANDLE_PX, track_x
from naisr_viewer.views.theme import Theme
from naisr_viewer.words.numbers import mean_reading, patient_reading
from naisr_viewer.words.titles import as_tip

BINS = 28

MARK_PX = 10
"""Width and height of the triangle at the patient's value."""

BAND_PX = 3.0
"""Height of the band beneath the bars that tells the patient's interval."""


def bin_counts(covariate: Covariate, observed: NDArray[np.float64]) -> NDArray[np.float64]:
    """How many subjects fall into each bin of the range, ``[n]`` bins; two of them for a binary one."""
    low, high = covariate.range
    bins = 2 if covariate.kind == "binary" else BINS
    return np.histogram(observed, bins=bins, range=(low, max(high, low + 1e-9)))[0].astype(float)


class Histogram(QWidget):
    """Where data exist: bars over the slider's range, a tick at the population mean, the patient's mark."""

    def __init__(self, covariate: Covariate, observed: NDArray[np.float64], parent: QWidget) -> None:
        super().__init__(parent)
        self._covariate = covariate
        self._counts = bin_counts(covariate, observed)
        self._patient: float | None = None
        self._interval: tuple[float, float] | None = None
        self._bar = self._tick = self._mark = self._rim = QColor()
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self._explain()

    def show_patient(self, value: float | None, interval: tuple[float, float] | None = None) -> None:
        """Mark a patient's value (real units).

        Args:
            value: None for nobody's.
            interval: low and high end (95 %) where the value was inferred; None where it was known.
        """
        if (value, interval) != (self._patient, self._interval):
            self._patient, self._interval = value, interval
            self._explain()
            self.update()

    def sizeHint(self) -> QSize:
        """As wide as there is room, low."""
        return QSize(120, 26)

    def set_colours(self, theme: Theme, colour: str) -> None:
        """Bars muted, the mean in the covariate's colour, the patient in that of the words."""
        self._bar, self._tick = QColor(theme.muted), QColor(colour)
        self._mark, self._rim = QColor(theme.text), QColor(theme.window)
        self._bar.setAlpha(110)
        self.update()

    def paintEvent(self, _event: QPaintEvent) -> None:
        """Bars first, the mean over them, then the patient."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        left, width, height = HANDLE_PX / 2, self.width() - HANDLE_PX, self.height() - BAND_PX
        step = width / len(self._counts)
        tallest = max(self._counts.max(), 1.0)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(self._bar)
        for index, count in enumerate(self._counts):
            bar = height * count / tallest
            painter.drawRect(QRectF(left + index * step, height - bar, max(step - 1.0, 1.0), bar))
        x = self._x(self._covariate.centre)
        painter.setPen(QPen(self._tick, 2.0))
        painter.drawLine(QPointF(x, 0.0), QPointF(x, self.height()))
        if self._patient is not None:
            self._paint_patient(painter, self._x(self._patient))
        painter.end()

    def _paint_patient(self, painter: QPainter, x: float) -> None:
        """A triangle that points at the value, and a band beneath the bars."""
        base = self.height() - BAND_PX
        corners = [(x, base - MARK_PX), (x + MARK_PX / 2, base), (x - MARK_PX / 2, base)]
        painter.setBrush(self._mark)
        painter.setPen(QPen(self._rim, 1.0))
        painter.drawPolygon(QPolygonF([QPointF(*corner) for corner in corners]))
        if self._interval is not None:
            low, high = map(self._x, self._interval)
            painter.fillRect(QRectF(low, base, max(high - low, 1.0), BAND_PX), self._mark)

    def _x(self, value: float) -> float:
        """The horizontal pixel coordinate under the slider's handle at a real value."""
        low, high = self._covariate.range
        share = (value - low) / (high - low) if high > low else 0.5
        return track_x(min(max(share, 0.0), 1.0), self.width())

    def _explain(self) -> None:
        """Say on hover what is drawn."""
        covariate = self._covariate
        marks = [f"Tick: population mean {mean_reading(covariate)}"]
        if self._patient is not None:
            marks.append(f"Triangle: {patient_reading(covariate, self._patient, self._interval)}")
        self.setToolTip(as_tip("\n".join([f"Bars: {self._bars_reading()}", *marks])))

    def _bars_reading(self) -> str:
        """Whom the bars count, in words."""
        if self._covariate.kind == "binary":
            levels = zip(self._counts, self._covariate.levels, strict=True)
            return " · ".join(f"{int(count)} {name}" for count, name in levels)
        return f"{int(self._counts.sum())} shapes behind the atlas, {self._covariate.extent}"
