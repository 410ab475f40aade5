"""Beneath the sliders: the people behind the atlas over two covariates, to be folded away."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Literal

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtGui import QHideEvent
from PySide6.QtWidgets import QHBoxLayout, QLabel, QSizePolicy, QToolButton, QVBoxLayout, QWidget

from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.support import Support, axes_of, marks_of, remoteness, visits_of, with_axis
from naisr_viewer.views.colours import patient_colour
from naisr_viewer.views.focus import in_order
from naisr_viewer.views.patients.pieces import ChoiceBox
from naisr_viewer.views.theme import LIGHT, Theme
from naisr_viewer.words import support as words
from naisr_viewer.words.titles import as_tip, label

if TYPE_CHECKING:
    from naisr_viewer.views.charts.scatter import Scatter

LEAST_PX, TALLEST_PX = 150, 300
"""Height of the chart."""

PAUSE_MS = 60
"""The edge of the data is drawn anew when the covariates that are not on the axes pause this long."""


class SupportPanel(QWidget):
    """A scatter of two covariates with a heading that folds it away, and a box for each axis.

    Args:
        parent: the widget around it.
    """

    support_requested = Signal(object)  # a Support: other covariates along the axes, or folded the other way
    values_moved = Signal(object)  # Named, real values: the ring is on its way
    values_settled = Signal(object)  # Named, real values: it came to rest

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.chart: Scatter | None = None
        self._state, self._theme = ExplorerState(), LIGHT
        self._has_room = False
        self._shown: dict[str, object] = {}
        self.fold = _fold_button(self)
        self.fold.clicked.connect(self._folded)
        self.upwards = self._axis_box("y", "Covariate upwards")
        self.along = self._axis_box("x", "Covariate along")
        self._over = QLabel("over", self)
        self._over.setObjectName("muted")
        self._body = QWidget(self)
        self._pause = QTimer(self, singleShot=True, interval=PAUSE_MS)
        self._pause.timeout.connect(self._show_edge)
        self._compose()

    @property
    def stops(self) -> list[QWidget]:
        """What the Tab key goes through, as it is read."""
        chart = [] if self.chart is None else [self.chart]
        return [self.fold, self.upwards, self.along, *chart]

    @property
    def unfolded_px(self) -> int:
        """The height that it needs."""
        return (
            self.fold.sizeHint().height()
            + self.upwards.sizeHint().height()
            + LEAST_PX
            + 3 * self._column.spacing()
        )

    def prepare(self) -> None:
        """Make the chart; it takes a tenth of a second, for which the first picture shall not wait."""
        if self.chart is not None:
            return
        from naisr_viewer.views.charts.scatter import Scatter

        self.chart = Scatter(self._body)
        self.chart.setMinimumHeight(LEAST_PX)
        self.chart.setMaximumHeight(TALLEST_PX)
        self.chart.setToolTip(as_tip(words.HINT))
        self.chart.set_theme(self._theme)
        self.chart.moved.connect(lambda place: self.values_moved.emit(self._named(place)))
        self.chart.settled.connect(lambda place: self.values_settled.emit(self._named(place)))
        self._inside.insertWidget(1, self.chart, 1)
        self.chart.show()  # a layout does so by the next event only
        in_order(self.stops)
        self.show_state(self._state)

    def show_state(self, state: ExplorerState) -> None:
        """Show the data over the covariates that are chosen, and where the shapes on screen are."""
        self._state = state
        has_two = state.atlas is not None and bool(state.support.x)
        self.setVisible(has_two)
        if not has_two:
            return
        is_open = self._is_open
        self._body.setVisible(is_open)
        self.fold.setArrowType(Qt.ArrowType.DownArrow if is_open else Qt.ArrowType.RightArrow)
        self.fold.setToolTip(
            "Fold the data away" if is_open else "Show where the people behind the atlas are"
        )
        if is_open:
            self._show_axes()
            self._show_chart()

    def show_room(self, room_px: int) -> None:
        """Say how high it can be before the sliders have to be scrolled."""
        has_room = room_px >= self.unfolded_px
        if has_room != self._has_room:
            self._has_room = has_room
            self.show_state(self._state)

    def set_theme(self, theme: Theme) -> None:
        """Follow the theme."""
        self._theme = theme
        if self.chart is not None:
            self.chart.set_theme(theme)
            self._shown.pop("marks", None)
            self.show_state(self._state)

    def forget_move(self) -> None:
        """Say no more of a movement that has not come to rest."""
        if self.chart is not None:
            self.chart.forget_move()

    def hideEvent(self, event: QHideEvent) -> None:
        """Nothing is drawn that nobody sees."""
        self._pause.stop()
        super().hideEvent(event)

    @property
    def _support(self) -> Support:
        return self._state.support

    @property
    def _is_open(self) -> bool:
        wanted = self._support.is_open
        return self._has_room if wanted is None else wanted

    def _named(self, place: tuple[float, float]) -> tuple[tuple[str, float], ...]:
        return (self._support.x, place[0]), (self._support.y, place[1])

    def _folded(self) -> None:
        self.support_requested.emit(replace(self._support, is_open=not self._is_open))

    def _axis_box(self, axis: Literal["x", "y"], name: str) -> ChoiceBox:
        box = ChoiceBox(name, name, self)
        box.setMinimumContentsLength(4)
        box.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        box.activated.connect(
            lambda _: self.support_requested.emit(with_axis(self._support, axis, box.currentData()))
        )
        return box

    def _show_axes(self) -> None:
        assert self._state.atlas is not None
        choices = [(one.name, label(one.name)) for one in self._state.atlas.covariates]
        self.along.show_choices(choices, self._support.x)
        self.upwards.show_choices(choices, self._support.y)

    def _show_chart(self) -> None:
        """Bring the chart up to date, touching only what changed: while the ring moves, nothing else."""
        state, atlas, support = self._state, self._state.atlas, self._support
        if self.chart is None or atlas is None:
            return
        values = dict(state.named)
        axes = (atlas, support.x, support.y)
        if self._is_new("axes", axes):
            self.chart.show_visits(axes_of(support, atlas), visits_of(support, atlas))
            self._shown.pop("others", None)
        if self._is_new("marks", (axes, state.patients)):
            colours = {patient.key: patient_colour(patient.key) for patient in state.patients}
            self.chart.show_marks(marks_of(support, state.patients), colours)
        is_first = "others" not in self._shown
        if self._is_new("others", tuple(value for name, value in state.named if name not in axes)):
            self._show_edge() if is_first else self._pause.start()
        self.chart.show_place(values[support.x], values[support.y])

    def _show_edge(self) -> None:
        assert self.chart is not None
        assert self._state.atlas is not None
        self.chart.show_edge(remoteness(self._support, self._state.atlas, dict(self._state.named)))

    def _is_new(self, what: str, now: object) -> bool:
        """Whether something differs from what is shown; it is taken for shown then."""
        was = self._shown.get(what)
        self._shown[what] = now
        return was != now

    def _compose(self) -> None:
        axes = QHBoxLayout()
        axes.setSpacing(6)
        axes.addWidget(self.upwards, 1)
        axes.addWidget(self._over)
        axes.addWidget(self.along, 1)
        self._inside = QVBoxLayout(self._body)
        self._inside.setContentsMargins(0, 0, 0, 0)
        self._inside.setSpacing(4)
        self._inside.addLayout(axes)
        self._inside.addStretch(0)
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(0, 0, 0, 0)
        self._column.setSpacing(4)
        self._column.addWidget(self.fold)
        self._column.addWidget(self._body, 1)
        self._column.addStretch(0)
        self.hide()


def _fold_button(parent: QWidget) -> QToolButton:
    button = QToolButton(parent)
    button.setObjectName("fold")
    button.setText(words.TITLE)
    button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
    button.setAutoRaise(True)
    return button
