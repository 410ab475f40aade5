"""The left side: one row per covariate, and what concerns all of them."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, QSignalBlocker, QSize, Qt, Signal
from PySide6.QtWidgets import QApplication, QFrame, QLabel, QPushButton, QScrollArea, QVBoxLayout, QWidget

from naisr_viewer.panels.maps import can_mute
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.views.colours import covariate_colour
from naisr_viewer.views.covariates.row import CovariateRow
from naisr_viewer.views.covariates.support import SupportPanel
from naisr_viewer.views.elided import ElidedCheckBox, ElidedLabel
from naisr_viewer.views.focus import in_order
from naisr_viewer.views.theme import Theme
from naisr_viewer.words.titles import label

PANEL_WIDTH = 320
LEAST_WIDTH = 248

FOLLOW_HINT = (
    "Moving one covariate takes the other continuous ones along the population's growth path,\n"
    "keeping this person's own distance from it."
)


class CovariatePanel(QFrame):
    """All covariates of an atlas."""

    value_moved = Signal(str, float)  # name, real value: a slider, key or wheel is on the way
    value_settled = Signal(str, float)  # name, real value: it came to rest
    values_moved = Signal(object)  # Named, real values: covariates that move together are on the way
    values_settled = Signal(object)  # Named, real values: they came to rest
    support_requested = Signal(object)  # a Support: the data over other covariates, or folded the other way
    reset_requested = Signal(str)  # name: the row's reset button was pressed
    refused = Signal(str)  # why a number that was typed is not taken
    play_clicked = Signal(str)  # name: it shall begin or end to move by itself
    mute_toggled = Signal(str, bool)  # name: whether it shall be left out of the full shape
    solo_toggled = Signal(str, bool)  # name: whether all others shall be left out of it
    reset_all_requested = Signal()  # "Reset all" was pressed
    follow_toggled = Signal(bool)  # whether the others shall follow the covariate that is moved

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("sidebar")
        self.setMinimumWidth(LEAST_WIDTH)
        self.setMaximumWidth(PANEL_WIDTH)
        self.rows: dict[str, CovariateRow] = {}
        self.title = ElidedLabel("", self)
        self.title.setObjectName("title")
        self.subtitle = QLabel(self)
        self.subtitle.setObjectName("muted")
        self.subtitle.setWordWrap(True)
        self.follow = ElidedCheckBox("Others follow as in the population", FOLLOW_HINT, self)
        self.follow.toggled.connect(self.follow_toggled)
        self.reset_all = QPushButton(self)
        self.reset_all.clicked.connect(self.reset_all_requested)
        self.support = SupportPanel(self)
        self.support.values_moved.connect(self.values_moved)
        self.support.values_settled.connect(self.values_settled)
        self.support.support_requested.connect(self.support_requested)
        self.support.fold.clicked.connect(self._scroll_to_support, Qt.ConnectionType.QueuedConnection)
        self._area = QScrollArea(self)
        self._rows_area = QVBoxLayout()
        self._rows_area.setSpacing(22)
        self._compose()

    def show_atlas(self, atlas: AtlasCard, theme: Theme) -> None:
        """Make the rows of ``atlas``."""
        for row in self.rows.values():
            self._rows_area.removeWidget(row)
            row.hide()  # it is there until the next event, under the title of the new atlas
            row.deleteLater()
        self.rows = {}
        for covariate in atlas.covariates:
            colour = covariate_colour(atlas, covariate.name)
            row = CovariateRow(covariate, atlas.population.observed(covariate.name), colour, self)
            row.value_moved.connect(self.value_moved)
            row.value_settled.connect(self.value_settled)
            row.reset_requested.connect(self.reset_requested)
            row.refused.connect(self.refused)
            row.play_clicked.connect(self.play_clicked)
            row.mute_toggled.connect(self.mute_toggled)
            row.solo_toggled.connect(self.solo_toggled)
            self.rows[covariate.name] = row
            self._rows_area.addWidget(row)
        self.title.setText(f"{label(atlas.name)} atlas")
        self.subtitle.setText(_origin(atlas))
        self.follow.setVisible(sum(covariate.kind == "continuous" for covariate in atlas.covariates) > 1)
        self.reset_all.setVisible(bool(atlas.covariates))
        in_order(self.stops)
        self.set_theme(theme)

    def sizeHint(self) -> QSize:
        """As wide as it may be; a narrow window gives it less."""
        return QSize(PANEL_WIDTH, super().sizeHint().height())

    @property
    def stops(self) -> list[QWidget]:
        """What the Tab key goes through, as it is read."""
        rows = [stop for row in self.rows.values() for stop in row.stops]
        return [self._area, *rows, self.follow, self.reset_all, *self.support.stops]

    def show_values(self, state: ExplorerState) -> None:
        """Put every row at its value, and say where home is: the patient's values or the population mean."""
        fit = state.fit
        told = fit.intervals if fit is not None and fit.is_valid else ()
        is_mutable = state.atlas is not None and can_mute(state.atlas)
        intervals = {name: (low, high) for name, low, high in told}
        for (name, value), home in zip(state.named, state.home, strict=True):
            self.rows[name].set_home(home, fit is not None, intervals.get(name))
            self.rows[name].set_value(value)
            others = set(self.rows) - {name}
            self.rows[name].show_mutes(is_mutable, name in state.muted, others == set(state.muted))
        self._show_support(state)
        with QSignalBlocker(self.follow):
            self.follow.setChecked(state.follow)
        self.reset_all.setText("Reset all" if fit is None else "Back to the patient")
        whose = "population mean" if fit is None else "patient's values"
        self.reset_all.setToolTip(f"Every covariate back to the {whose} (Ctrl+R)")

    def forget_moves(self) -> None:
        """Say no more of movements that have not come to rest."""
        for row in self.rows.values():
            row.forget_move()
        self.support.forget_move()

    def set_theme(self, theme: Theme) -> None:
        """Follow the theme."""
        self.support.set_theme(theme)
        for row in self.rows.values():
            row.set_colours(theme)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """There may be room for the data now, or none any more."""
        if event.type() in (QEvent.Type.Resize, QEvent.Type.LayoutRequest):
            self._show_room()
        return super().eventFilter(watched, event)

    def _show_support(self, state: ExplorerState) -> None:
        """Say where the data are, of each covariate while the others are as they are."""
        if state.atlas is not None:
            values = dict(state.named)
            for name, row in self.rows.items():
                row.show_stretches(state.atlas.population.stretches_with_data(name, values))
        self.support.show_state(state)

    def _show_room(self) -> None:
        """Say how high the data can be before the sliders have to be scrolled."""
        width = self._area.viewport().width()
        height = self._column.totalMinimumHeightForWidth(width)
        mine = 0 if self.support.isHidden() else self.support.minimumSizeHint().height()
        self.support.show_room(self._area.viewport().height() - height + mine)

    def _scroll_to_support(self) -> None:
        """Bring into sight what was unfolded, once it has its place."""
        QApplication.sendPostedEvents(None, QEvent.Type.LayoutRequest.value)
        self._area.ensureWidgetVisible(self.support, 0, 0)

    def _compose(self) -> None:
        inside = QWidget(self)
        self._column = column = QVBoxLayout(inside)
        column.setContentsMargins(14, 16, 14, 16)
        column.setSpacing(4)
        column.addWidget(self.title)
        column.addWidget(self.subtitle)
        column.addSpacing(18)
        column.addLayout(self._rows_area)
        column.addSpacing(20)
        column.addWidget(self.follow)
        column.addSpacing(10)
        column.addWidget(self.reset_all)
        column.addSpacing(6)
        column.addWidget(self.support, 1)
        column.addStretch(0)
        self.follow.setVisible(False)
        self.reset_all.setVisible(False)
        self._area.setWidget(inside)
        self._area.setWidgetResizable(True)
        for part in (self._area.viewport(), inside):
            part.installEventFilter(self)
        self._area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        outer = QVBoxLayout(self)
        outer.setContentsMargins(0, 0, 1, 0)
        outer.addWidget(self._area)


def _origin(atlas: AtlasCard) -> str:
    training = ~atlas.population.held_out
    subjects = {s for s, used in zip(atlas.population.subjects, training, strict=True) if used}
    origin = f"from {int(training.sum())} shapes of {len(subjects)} subjects"
    return origin if atlas.covariates else f"{origin}; its shapes depend on no covariates"
