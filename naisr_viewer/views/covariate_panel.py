"""The left side: one row per covariate with slider, number, reset and histogram."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, QSignalBlocker, QSize, Qt, QTimer, Signal
from PySide6.QtGui import QColor, QMouseEvent, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import (
    QCheckBox,
    QDoubleSpinBox,
    QFrame,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QScrollArea,
    QSizePolicy,
    QSlider,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from naisr_model.covariates import Covariate
from naisr_viewer.state import AtlasCard, ExplorerState, label
from naisr_viewer.views.theme import Theme, covariate_colour

SLIDER_STEPS = 1000
"""Positions of a slider; a key press moves ten of them."""

HANDLE_PX = 16
"""Diameter of the slider handle; the histogram leaves half of it free on both sides."""

BINS = 28

MARK_PX = 10
"""Width and height of the triangle at the patient's value."""

BAND_PX = 3.0
"""Height of the band beneath the bars that tells the patient's interval."""

SETTLE_MS = 400
"""Keys and wheel count as one movement until they pause this long."""

PANEL_WIDTH = 320

FOLLOW_HINT = (
    "Moving one covariate takes the other continuous ones along the population's growth path,\n"
    "keeping this person's own distance from it."
)


def slider_position(covariate: Covariate, value: float) -> int:
    """The slider position nearest to a real value."""
    low, high = covariate.range
    share = (value - low) / (high - low) if high > low else 0.0
    return round(min(max(share, 0.0), 1.0) * SLIDER_STEPS)


def slider_value(covariate: Covariate, position: int) -> float:
    """The real value at a slider position."""
    low, high = covariate.range
    return low + (high - low) * position / SLIDER_STEPS


def decimals(covariate: Covariate) -> int:
    """Digits after the point that tell about a thousand steps of the range apart."""
    low, high = covariate.range
    return max(0, min(6, 2 - math.floor(math.log10(max(high - low, 1e-6)))))


def reading(covariate: Covariate, value: float) -> str:
    """The value with its unit and as many digits as its number box has: ``84 months``, ``M``."""
    if covariate.kind == "binary":
        return covariate.format(round(value, 2))
    return f"{value:.{decimals(covariate)}f} {covariate.unit}".rstrip()


def patient_reading(covariate: Covariate, value: float, interval: tuple[float, float] | None) -> str:
    """The patient's value in words: ``patient 21.3 kg, 95 %: 18.2 to 24.9``."""
    text = f"patient {reading(covariate, value)}"
    if interval is None:
        return text
    digits = 2 if covariate.kind == "binary" else decimals(covariate)
    low, high = (f"{end:.{digits}f}".replace("-", "−") for end in interval)
    return f"{text}, 95 %: {low} to {high}"


def mean_reading(covariate: Covariate) -> str:
    """The population mean in words; halfway between the levels of a binary covariate."""
    return "in the middle" if covariate.kind == "binary" else reading(covariate, covariate.centre)


def bin_counts(covariate: Covariate, observed: NDArray[np.float64]) -> NDArray[np.float64]:
    """How many subjects fall into each bin of the range, ``[n]`` bins; two of them for a binary one."""
    low, high = covariate.range
    bins = 2 if covariate.kind == "binary" else BINS
    return np.histogram(observed, bins=bins, range=(low, max(high, low + 1e-9)))[0].astype(float)


class JumpSlider(QSlider):
    """A slider whose handle comes to where it is pressed, and can be dragged on from there."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(Qt.Orientation.Horizontal, parent)
        self.setRange(0, SLIDER_STEPS)
        self.setSingleStep(SLIDER_STEPS // 100)
        self.setPageStep(SLIDER_STEPS // 10)

    def position_at(self, x: float) -> int:
        """The slider position under a horizontal pixel coordinate."""
        usable = max(1.0, self.width() - HANDLE_PX)
        return round(min(max((x - HANDLE_PX / 2) / usable, 0.0), 1.0) * SLIDER_STEPS)

    def handle_x(self) -> float:
        """The horizontal pixel coordinate of the handle's centre."""
        return HANDLE_PX / 2 + self.sliderPosition() / SLIDER_STEPS * (self.width() - HANDLE_PX)

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

    def set_colours(self, theme: Theme, colour: str) -> None:
        """Paint the filled part in the covariate's colour."""
        half = HANDLE_PX // 2
        self.setStyleSheet(f"""
            QSlider {{ min-height: {HANDLE_PX + 4}px; }}
            QSlider::groove:horizontal {{ height: 4px; background: {theme.line}; border-radius: 2px; }}
            QSlider::sub-page:horizontal {{ background: {colour}; border-radius: 2px; }}
            QSlider::handle:horizontal {{ background: {theme.raised}; border: 2px solid {colour};
                width: {HANDLE_PX - 4}px; height: {HANDLE_PX - 4}px; margin: -{half - 2}px 0;
                border-radius: {half}px; }}
            QSlider::handle:horizontal:hover, QSlider::handle:horizontal:focus {{ background: {colour}; }}
        """)


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
        return HANDLE_PX / 2 + min(max(share, 0.0), 1.0) * (self.width() - HANDLE_PX)

    def _explain(self) -> None:
        """Say on hover what is drawn."""
        covariate = self._covariate
        marks = [f"Tick: population mean {mean_reading(covariate)}"]
        if self._patient is not None:
            marks.append(f"Triangle: {patient_reading(covariate, self._patient, self._interval)}")
        self.setToolTip("\n".join([f"Bars: {self._bars_reading()}", *marks]))

    def _bars_reading(self) -> str:
        """Whom the bars count, in words."""
        if self._covariate.kind == "binary":
            levels = zip(self._counts, self._covariate.levels, strict=True)
            return " · ".join(f"{int(count)} {name}" for count, name in levels)
        low, high = self._covariate.range
        where = f"between {low:g} and {high:g} {self._covariate.unit}".rstrip()
        return f"{int(self._counts.sum())} shapes behind the atlas {where}"


class CovariateRow(QWidget):
    """One covariate. Shows what it is told; says what the user does."""

    value_moved = Signal(str, float)  # name, real value: on the way, more will follow
    value_settled = Signal(str, float)  # name, real value: the user let go or paused
    reset_requested = Signal(str)  # name: the reset button was pressed

    def __init__(
        self, covariate: Covariate, observed: NDArray[np.float64], colour: str, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self.covariate = covariate
        self._colour = colour
        self.slider = JumpSlider(self)
        self.slider.setAccessibleName(label(covariate.name))
        self.histogram = Histogram(covariate, observed, self)
        self.reset = _reset_button(covariate, self)
        self.spin = ValueBox(covariate, self) if covariate.kind == "continuous" else None
        levels = covariate.levels if covariate.kind == "binary" else ()
        self.buttons = [
            LevelButton(name, value, self) for name, value in zip(levels, (-1.0, 1.0), strict=False)
        ]
        self.reading = QLabel(self)
        self.reading.setObjectName("muted")
        self.set_home(covariate.centre, is_patient=False)
        self._pending: float | None = None
        self._settle = QTimer(self, singleShot=True, interval=SETTLE_MS)
        self._compose()
        self._connect()

    @property
    def reach(self) -> str:
        """The range in words: ``1 to 233 months``, ``F to M``."""
        low, high = map(self.covariate.format, self.covariate.range)
        return f"{low.removesuffix(self.covariate.unit).strip()} to {high}"

    def set_home(self, value: float, is_patient: bool, interval: tuple[float, float] | None = None) -> None:
        """Say where the row is reset to.

        Args:
            value: real value.
            is_patient: whether it is a patient's, and is marked; else the population mean.
            interval: of a patient's value that was inferred: low and high end (95 %).
        """
        self._home = value
        self.histogram.show_patient(value if is_patient else None, interval)
        whose = f"patient ({reading(self.covariate, value)})"
        mean = f"population mean ({mean_reading(self.covariate)})"
        self.reset.setToolTip(f"Back to the {whose if is_patient else mean}")

    def set_value(self, value: float) -> None:
        """Show a real value without telling anybody."""
        with QSignalBlocker(self.slider):
            self.slider.setValue(slider_position(self.covariate, value))
        if self.spin is not None:
            with QSignalBlocker(self.spin):
                self.spin.setValue(value)
        for button in self.buttons:
            button.setChecked(button.level == value)
        self.reset.setEnabled(value != self._home)
        self.reading.setText(self.covariate.format(round(value, 2)))

    def forget_move(self) -> None:
        """Say no more of a movement that has not come to rest."""
        self._settle.stop()
        self._pending = None
        self.slider.setSliderDown(False)

    def set_colours(self, theme: Theme) -> None:
        """Follow the theme."""
        self.slider.set_colours(theme, self._colour)
        self.histogram.set_colours(theme, self._colour)

    def _compose(self) -> None:
        stripe = QFrame(self)
        stripe.setFixedWidth(4)
        stripe.setStyleSheet(f"background: {self._colour}; border-radius: 2px;")
        name = QLabel(label(self.covariate.name), self)
        name.setObjectName("covariate")
        unit = QLabel(self.covariate.unit, self)
        unit.setObjectName("muted")
        head = QHBoxLayout()
        head.setSpacing(6)
        head.addWidget(name)
        head.addStretch(1)
        for widget in (self.reading, self.spin, unit, self.reset):
            if widget is not None:
                head.addWidget(widget)
        self.reading.setVisible(self.spin is None)
        unit.setVisible(bool(self.covariate.unit))
        track = QGridLayout()
        track.setHorizontalSpacing(4)
        track.setVerticalSpacing(2)
        track.setColumnStretch(1, 1)
        track.addWidget(self.slider, 0, 1)
        track.addWidget(self.histogram, 1, 1)
        for column, button in zip((0, 2), self.buttons, strict=False):
            track.addWidget(button, 0, column)
        body = QVBoxLayout()
        body.setSpacing(2)
        body.addLayout(head)
        body.addLayout(track)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(10)
        row.addWidget(stripe)
        row.addLayout(body, 1)

    def _connect(self) -> None:
        self.slider.valueChanged.connect(self._slider_changed)
        self.slider.sliderReleased.connect(self._settled)
        self._settle.timeout.connect(self._settled)
        self.reset.clicked.connect(lambda: self.reset_requested.emit(self.covariate.name))
        if self.spin is not None:
            self.spin.valueChanged.connect(self._moved)
        for button in self.buttons:
            button.clicked.connect(self._level_chosen)

    def _slider_changed(self, position: int) -> None:
        self._moved(slider_value(self.covariate, position))
        if self.slider.isSliderDown():
            self._settle.stop()

    def _moved(self, value: float) -> None:
        self._pending = value
        self.value_moved.emit(self.covariate.name, value)
        self._settle.start()

    def _settled(self) -> None:
        self._settle.stop()
        if self._pending is not None:
            value, self._pending = self._pending, None
            self.value_settled.emit(self.covariate.name, value)

    def _level_chosen(self) -> None:
        button = self.sender()
        assert isinstance(button, LevelButton)
        self.value_settled.emit(self.covariate.name, button.level)


class ValueBox(QDoubleSpinBox):
    """A real value of a continuous covariate, inside its observed range."""

    def __init__(self, covariate: Covariate, parent: QWidget) -> None:
        super().__init__(parent)
        low, high = covariate.range
        self.setDecimals(decimals(covariate))
        self.setRange(low, high)
        self.setSingleStep(10.0 ** (1 - decimals(covariate)))
        self.setKeyboardTracking(False)
        self.setAlignment(Qt.AlignmentFlag.AlignRight)
        self.setFixedWidth(76)
        self.setToolTip(f"{low:g} to {high:g} {covariate.unit}".strip())
        self.setAccessibleName(f"{label(covariate.name)} in {covariate.unit}".removesuffix(" in "))


class LevelButton(QPushButton):
    """One level of a binary covariate."""

    def __init__(self, level: str, value: float, parent: QWidget) -> None:
        super().__init__(level, parent)
        self.level = value
        self.setCheckable(True)
        self.setMinimumWidth(38)
        self.setStyleSheet("padding: 3px 6px;")


def _reset_button(covariate: Covariate, parent: QWidget) -> QToolButton:
    button = QToolButton(parent)
    button.setText("↺")
    button.setAutoRaise(True)
    button.setAccessibleName(f"Reset {label(covariate.name)}")
    return button


class CovariatePanel(QFrame):
    """All covariates of an atlas."""

    value_moved = Signal(str, float)  # name, real value: a slider, key or wheel is on the way
    value_settled = Signal(str, float)  # name, real value: it came to rest
    reset_requested = Signal(str)  # name: the row's reset button was pressed
    reset_all_requested = Signal()  # "Reset all" was pressed
    follow_toggled = Signal(bool)  # whether the others shall follow the covariate that is moved

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("sidebar")
        self.setFixedWidth(PANEL_WIDTH)
        self.rows: dict[str, CovariateRow] = {}
        self.title = QLabel(self)
        self.title.setObjectName("title")
        self.subtitle = QLabel(self)
        self.subtitle.setObjectName("muted")
        self.subtitle.setWordWrap(True)
        self.follow = QCheckBox("Others follow as in the population", self)
        self.follow.setToolTip(FOLLOW_HINT)
        self.follow.toggled.connect(self.follow_toggled)
        self.reset_all = QPushButton(self)
        self.reset_all.clicked.connect(self.reset_all_requested)
        self._rows_area = QVBoxLayout()
        self._rows_area.setSpacing(22)
        self._compose()

    def show_atlas(self, atlas: AtlasCard, theme: Theme) -> None:
        """Make the rows of ``atlas``."""
        for row in self.rows.values():
            self._rows_area.removeWidget(row)
            row.deleteLater()
        self.rows = {}
        for covariate in atlas.covariates:
            colour = covariate_colour(atlas, covariate.name)
            row = CovariateRow(covariate, atlas.population.observed(covariate.name), colour, self)
            row.value_moved.connect(self.value_moved)
            row.value_settled.connect(self.value_settled)
            row.reset_requested.connect(self.reset_requested)
            self.rows[covariate.name] = row
            self._rows_area.addWidget(row)
        self.title.setText(f"{label(atlas.name)} atlas")
        self.subtitle.setText(_origin(atlas))
        self.follow.setVisible(sum(covariate.kind == "continuous" for covariate in atlas.covariates) > 1)
        self.reset_all.setVisible(True)
        self.set_theme(theme)

    def show_values(self, state: ExplorerState) -> None:
        """Put every row at its value, and say where home is: the patient's values or the population mean."""
        fit = state.fit
        intervals = {name: (low, high) for name, low, high in fit.intervals} if fit is not None else {}
        for (name, value), home in zip(state.named, state.home, strict=True):
            self.rows[name].set_home(home, fit is not None, intervals.get(name))
            self.rows[name].set_value(value)
        with QSignalBlocker(self.follow):
            self.follow.setChecked(state.follow)
        self.reset_all.setText("Reset all" if fit is None else "Back to the patient")
        whose = "population mean" if fit is None else "patient's values"
        self.reset_all.setToolTip(f"Every covariate back to the {whose} (Ctrl+R)")

    def forget_moves(self) -> None:
        """Say no more of movements that have not come to rest."""
        for row in self.rows.values():
            row.forget_move()

    def set_theme(self, theme: Theme) -> None:
        """Follow the theme."""
        for row in self.rows.values():
            row.set_colours(theme)

    def _compose(self) -> None:
        inside = QWidget(self)
        column = QVBoxLayout(inside)
        column.setContentsMargins(18, 16, 18, 16)
        column.setSpacing(4)
        column.addWidget(self.title)
        column.addWidget(self.subtitle)
        column.addSpacing(18)
        column.addLayout(self._rows_area)
        column.addSpacing(20)
        column.addWidget(self.follow)
        column.addSpacing(10)
        column.addWidget(self.reset_all)
        column.addStretch(1)
        self.follow.setVisible(False)
        self.reset_all.setVisible(False)
        area = QScrollArea(self)
        area.setWidget(inside)
        area.setWidgetResizable(True)
        area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        outer = QVBoxLayout(self)
        outer.setContentsMargins(0, 0, 1, 0)
        outer.addWidget(area)


def _origin(atlas: AtlasCard) -> str:
    training = ~atlas.population.held_out
    subjects = {s for s, used in zip(atlas.population.subjects, training, strict=True) if used}
    return f"from {int(training.sum())} shapes of {len(subjects)} subjects"
