"""The drawer's page Curve: a measure along a covariate, with a line at what is on screen."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from PySide6.QtCore import Qt, Signal, SignalInstance
from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QLabel, QWidget

from naisr_model.covariates import Covariate
from naisr_viewer.panels.curves import covariate_of
from naisr_viewer.state.curves import NOTHING_RECKONED, Curves, MeasureCurve, Reckoning
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.views.colours import covariate_colour, patient_colour
from naisr_viewer.views.elided import ElidedLabel
from naisr_viewer.views.focus import in_order
from naisr_viewer.views.patients.pieces import ChoiceBox, button
from naisr_viewer.views.theme import LIGHT, Theme
from naisr_viewer.words import curves as words
from naisr_viewer.words.titles import as_tip, label

if TYPE_CHECKING:
    from naisr_viewer.views.charts.curves import CurveChart

LEAST_SIDE_PX, SIDE_PX = 200, 252
"""Width of what stands beside the chart."""

CSV_TIP = "Write the curve, what 95 % of people have, the patient and the people as a table"
SVG_TIP = "Write the chart as a picture"


class Shown(NamedTuple):
    """What the chart shows.

    Attributes:
        covariate: along which.
        curves: the answer.
        curve: which of it.
        colours: of the covariate and of the patient.
    """

    covariate: Covariate
    curves: Curves
    curve: MeasureCurve
    colours: tuple[str, str]


class CurvePage(QWidget):
    """A chart, a box for what is measured and one for along what, and what can be done with it."""

    choice_requested = Signal(object)  # a CurveChoice: another measure, or along another covariate
    value_moved = Signal(str, float)  # name, real value: the line is on its way
    value_settled = Signal(str, float)  # name, real value: it came to rest
    save_requested = Signal(str)  # the ending of a file that the curve shall be written to
    reckoning_requested = Signal(bool)  # whether it shall be worked out what is usual, or that be stopped

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.chart: CurveChart | None = None
        self._state, self._theme = ExplorerState(), LIGHT
        self._curves: Curves | None = None
        self._reckoning, self._is_measuring, self._trouble = NOTHING_RECKONED, False, ""
        self.measure = ChoiceBox("Measure", "What is measured", self)
        self.along = ChoiceBox("Along", "Along which covariate", self)
        self.told, self.note = QLabel(self), ElidedLabel("", self)
        self.told.setTextFormat(Qt.TextFormat.PlainText)
        self.told.setWordWrap(True)
        self.note.setObjectName("muted")
        self.csv, self.svg = button("CSV…", CSV_TIP, "small"), button("SVG…", SVG_TIP, "small")
        self.begin = button("", "Work out what is usual among the people of the atlas", "small")
        self._connect()
        self._compose()

    @property
    def stops(self) -> list[QWidget]:
        """What the Tab key goes through, as it is read."""
        chart = [] if self.chart is None else [self.chart]
        return [self.measure, self.csv, self.along, self.svg, self.begin, *chart]

    def prepare(self) -> None:
        """Make the chart; for that the first picture shall not wait."""
        if self.chart is not None:
            return
        from naisr_viewer.views.charts.curves import CurveChart

        self.chart = CurveChart(self)
        self.chart.setToolTip(as_tip(words.HINT))
        self.chart.set_theme(self._theme)
        self.chart.moved.connect(lambda place: self._say(self.value_moved, *place))
        self.chart.settled.connect(lambda place: self._say(self.value_settled, *place))
        self._row.insertWidget(1, self.chart, 2)
        in_order(self.stops)
        self._fill()

    def show_state(self, state: ExplorerState) -> None:
        """Put the line where the state says."""
        old, self._state = self._state, state
        if state.atlas is not old.atlas:
            self._curves = None
        if (state.atlas, state.curve, state.patient) != (old.atlas, old.curve, old.patient):
            self._fill()
        elif state.touched != old.touched:
            self._show_boxes()
        self._show_place()

    def show_curves(self, curves: Curves | None, is_measuring: bool = False, trouble: str = "") -> None:
        """Show what was measured; None where nothing is known.

        Args:
            curves: the answer.
            is_measuring: whether a newer one is on its way.
            trouble: why there is none, a sentence; empty where there is no reason.
        """
        is_new = curves is not self._curves
        self._curves, self._is_measuring, self._trouble = curves, is_measuring, trouble
        if is_new:
            self._fill()
            self._show_place()
        self._show_notes()

    def show_reckoning(self, reckoning: Reckoning) -> None:
        """Say how far it is known what is usual."""
        self._reckoning = reckoning
        self._show_notes()

    def set_theme(self, theme: Theme) -> None:
        """Follow the theme."""
        self._theme = theme
        if self.chart is not None:
            self.chart.set_theme(theme)

    def forget_move(self) -> None:
        """Say no more of a movement that has not come to rest."""
        if self.chart is not None:
            self.chart.forget_move()

    def picture(self) -> bytes:
        """What is shown as SVG, on a light ground; there is something."""
        from naisr_viewer.views.charts.curves import CurveChart, picture

        shown = self._shown
        assert shown is not None
        chart = CurveChart(self)
        chart.set_theme(LIGHT)
        chart.show_curve(*shown)
        chart.show_place(self._place)
        try:
            return picture(chart)
        finally:
            chart.hide()
            chart.deleteLater()

    @property
    def _shown(self) -> Shown | None:
        atlas, curves = self._state.atlas, self._curves
        if atlas is None or curves is None or curves.request.atlas != atlas.path:
            return None
        covariate = atlas.covariates[atlas.index(curves.request.covariate)]
        patient = self._state.patient
        colours = (
            covariate_colour(atlas, covariate.name),
            self._theme.accent if patient is None else patient_colour(patient),
        )
        return Shown(covariate, curves, curves.find(self._state.curve.measure), colours)

    @property
    def _place(self) -> float:
        assert self._curves is not None
        return dict(self._state.named)[self._curves.request.covariate]

    def _say(self, signal: SignalInstance, value: float) -> None:
        if self._curves is not None:
            signal.emit(self._curves.request.covariate, value)

    def _choose(self) -> None:
        choice = replace(
            self._state.curve, measure=self.measure.currentData(), covariate=self.along.currentData()
        )
        self.choice_requested.emit(choice)

    def _fill(self) -> None:
        """Show another curve, or none."""
        shown = self._shown
        for each in (self.csv, self.svg):
            each.setEnabled(shown is not None)
        if self.chart is not None:
            self.chart.setVisible(shown is not None)
            if shown is not None:
                self.chart.show_curve(*shown)
        self._show_boxes()

    def _show_boxes(self) -> None:
        state, shown = self._state, self._shown
        if state.atlas is None or not state.atlas.covariates:
            return
        names = [(one.name, label(one.name)) for one in state.atlas.covariates]
        last = label(covariate_of(replace(state, curve=replace(state.curve, covariate=""))))
        self.along.show_choices([("", f"{last} ({words.LAST_MOVED})"), *names], state.curve.covariate)
        if shown is not None:
            measures = shown.curves.measures
            self.measure.show_choices([(one.name, one.title) for one in measures], shown.curve.name)
            self.measure.setToolTip(as_tip(words.hint(shown.curve)))
            for index, one in enumerate(measures):
                self.measure.setItemData(index, as_tip(words.hint(one)), Qt.ItemDataRole.ToolTipRole)

    def _show_place(self) -> None:
        shown = self._shown
        if shown is None:
            self.told.setText("")
            return
        if self.chart is not None:
            self.chart.show_place(self._place)
        self.told.setText(words.told(shown.covariate, shown.curves, shown.curve, self._place))

    def _show_notes(self) -> None:
        reckoning = self._reckoning
        busy = words.MEASURING if self._is_measuring else words.reckoned(reckoning)
        self.note.setText(self._trouble or busy)
        self.begin.setVisible(reckoning.share is not None or reckoning.can_begin)
        self.begin.setText("Work out" if reckoning.share is None else "Cancel")

    def _connect(self) -> None:
        self.begin.clicked.connect(lambda: self.reckoning_requested.emit(self._reckoning.share is None))
        self.csv.clicked.connect(lambda: self.save_requested.emit(".csv"))
        self.svg.clicked.connect(lambda: self.save_requested.emit(".svg"))
        for box in (self.measure, self.along):
            box.activated.connect(lambda _: self._choose())

    def _compose(self) -> None:
        side = QWidget(self)
        side.setMinimumWidth(LEAST_SIDE_PX)
        side.setMaximumWidth(SIDE_PX)
        grid = QGridLayout(side)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setSpacing(4)
        grid.setColumnStretch(0, 1)
        grid.setRowStretch(2, 1)
        for row, beside in enumerate(((self.measure, self.csv), (self.along, self.svg))):
            for column, widget in enumerate(beside):
                grid.addWidget(widget, row, column)
        grid.addWidget(self.told, 2, 0, 1, 2)
        self.told.setAlignment(Qt.AlignmentFlag.AlignTop)
        grid.addWidget(self.note, 3, 0)
        grid.addWidget(self.begin, 3, 1)
        self._row = QHBoxLayout(self)
        self._row.setContentsMargins(14, 2, 8, 6)
        self._row.setSpacing(12)
        self._row.addWidget(side, 1)
        self._row.addStretch(0)
        self._show_notes()
