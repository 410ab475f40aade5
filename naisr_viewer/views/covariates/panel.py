"""The left side: one row per covariate with slider, number, reset and histogram."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QSignalBlocker, Qt, QTimer, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QFrame,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QScrollArea,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from naisr_model.covariates import Covariate
from naisr_viewer.state.explorer import AtlasCard, ExplorerState, label
from naisr_viewer.views.covariates.histogram import Histogram
from naisr_viewer.views.covariates.slider import JumpSlider, slider_position, slider_value
from naisr_viewer.views.theme import Theme, covariate_colour
from naisr_viewer.views.value_inputs import LevelButton, ValueBox, level_buttons
from naisr_viewer.words.numbers import mean_reading, reading

SETTLE_MS = 400
"""Keys and wheel count as one movement until they pause this long."""

PANEL_WIDTH = 320

FOLLOW_HINT = (
    "Moving one covariate takes the other continuous ones along the population's growth path,\n"
    "keeping this person's own distance from it."
)


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
        self.buttons = level_buttons(covariate, self) if covariate.kind == "binary" else []
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
