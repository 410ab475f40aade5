"""One covariate: slider, number, reset and histogram."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QSignalBlocker, QTimer, Signal
from PySide6.QtWidgets import QFrame, QGridLayout, QHBoxLayout, QToolButton, QVBoxLayout, QWidget

from naisr_model.covariates import Covariate
from naisr_viewer.views.covariates.histogram import Histogram
from naisr_viewer.views.covariates.slider import JumpSlider, chosen_value, share_of, slider_position
from naisr_viewer.views.elided import ElidedLabel, unit_label
from naisr_viewer.views.level_buttons import LevelButton, level_buttons
from naisr_viewer.views.number_box import NumberBox
from naisr_viewer.views.theme import Theme
from naisr_viewer.words import maps as words
from naisr_viewer.words.numbers import mean_reading, reading
from naisr_viewer.words.support import along
from naisr_viewer.words.titles import as_tip, label

NAME_PX = 32
"""A name is never narrower; the unit gives way."""

LEAST_TOOL_PX, TOOL_PX = 15, 20
READING_PX = 150
"""A level in words is never wider."""

SETTLE_MS = 400
"""Keys and wheel count as one movement until they pause this long."""


class CovariateRow(QWidget):
    """One covariate. Shows what it is told; says what the user does."""

    value_moved = Signal(str, float)  # name, real value: on the way, more will follow
    value_settled = Signal(str, float)  # name, real value: the user let go or paused
    reset_requested = Signal(str)  # name: the reset button was pressed
    refused = Signal(str)  # why a number that was typed is not taken
    play_clicked = Signal(str)  # name: it shall begin or end to move by itself
    mute_toggled = Signal(str, bool)  # name: whether it shall be left out of the full shape
    solo_toggled = Signal(str, bool)  # name: whether all others shall be left out of it

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
        self.play = _switch("▸", words.PLAY, covariate, self)
        self.mute = _switch("⊘", words.MUTE, covariate, self)
        self.solo = _switch("◎", words.SOLO, covariate, self)
        self.box = NumberBox(covariate, self) if covariate.kind == "continuous" else None
        self.buttons = level_buttons(covariate, self) if covariate.kind == "binary" else []
        self.reading = unit_label("", self)
        self.reading.setMaximumWidth(READING_PX)
        self.set_home(covariate.centre, is_patient=False)
        self._pending: float | None = None
        self._settle = QTimer(self, singleShot=True, interval=SETTLE_MS)
        self._compose()
        self._connect()

    @property
    def reach(self) -> str:
        """The range in words: ``1 to 233 months``, ``F or M``."""
        return self.covariate.extent

    @property
    def stops(self) -> list[QWidget]:
        """What the Tab key goes through, as it is read."""
        boxes = [] if self.box is None else [self.box]
        return [
            *boxes,
            self.reset,
            self.play,
            self.solo,
            self.mute,
            *self.buttons[:1],
            self.slider,
            *self.buttons[1:],
        ]

    def set_home(self, value: float, is_patient: bool, interval: tuple[float, float] | None = None) -> None:
        """Say where the row is reset to.

        Args:
            value: real value.
            is_patient: whether it is a patient's, and is marked; else the population mean.
            interval: of a patient's value that was inferred: low and high end (95 %).
        """
        self._home = value
        self.histogram.show_patient(value if is_patient else None, interval)
        goal = reading(self.covariate, value)
        if is_patient:
            goal = f"the patient ({goal})"
        elif value == self.covariate.centre:
            goal = f"the population mean ({mean_reading(self.covariate)})"
        self.reset.setToolTip(as_tip(f"Back to {goal}"))

    def set_value(self, value: float) -> None:
        """Show a real value without telling anybody."""
        with QSignalBlocker(self.slider):
            self.slider.setValue(slider_position(self.covariate, value))
        if self.box is not None:
            self.box.show_value(value)
        for button in self.buttons:
            button.setChecked(button.level == value)
        self.reset.setEnabled(value != self._home)
        self.reading.setText(reading(self.covariate, value))

    def show_stretches(self, stretches: tuple[tuple[float, float], ...]) -> None:
        """Say where along the slider there are data, by low and high ends in real units."""
        self.slider.show_stretches(
            tuple((share_of(self.covariate, low), share_of(self.covariate, high)) for low, high in stretches)
        )
        self.slider.setToolTip(as_tip(along(self.covariate, stretches)))

    def show_mutes(self, is_offered: bool, is_muted: bool, is_alone: bool) -> None:
        """Say whether the covariate is left out of the full shape, or alone in it."""
        for button, is_on in ((self.mute, is_muted), (self.solo, is_alone)):
            button.setVisible(is_offered)
            button.setChecked(is_on)

    def show_playing(self, is_playing: bool) -> None:
        """Whether the covariate moves by itself."""
        self.play.setChecked(is_playing)

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
        name = ElidedLabel(label(self.covariate.name), self)
        name.setObjectName("covariate")
        name.setMinimumWidth(NAME_PX)
        unit = unit_label(self.covariate.unit, self)
        head = QHBoxLayout()
        head.setSpacing(4)
        head.addWidget(name, 1)
        for widget in (self.reading, self.box, unit):
            if widget is not None:
                head.addWidget(widget)
        tools = QHBoxLayout()
        tools.setSpacing(0)
        for tool in (self.reset, self.play, self.solo, self.mute):
            tool.setMinimumWidth(LEAST_TOOL_PX)
            tool.setMaximumWidth(TOOL_PX)
            tools.addWidget(tool)
        head.addLayout(tools)
        self.reading.setVisible(self.box is None)
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
        self.play.clicked.connect(lambda: self.play_clicked.emit(self.covariate.name))
        self.mute.clicked.connect(lambda on: self.mute_toggled.emit(self.covariate.name, on))
        self.solo.clicked.connect(lambda on: self.solo_toggled.emit(self.covariate.name, on))
        if self.box is not None:
            self.box.committed.connect(self._moved)
            self.box.refused.connect(self.refused)
        for button in self.buttons:
            button.clicked.connect(self._level_chosen)

    def _slider_changed(self, position: int) -> None:
        self._moved(chosen_value(self.covariate, position))
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


def _switch(sign: str, hint: str, covariate: Covariate, parent: QWidget) -> QToolButton:
    button = QToolButton(parent)
    button.setText(sign)
    button.setCheckable(True)
    button.setAutoRaise(True)
    told = hint.format(covariate=label(covariate.name))
    button.setAccessibleName(told)
    button.setToolTip(as_tip(told))
    return button
