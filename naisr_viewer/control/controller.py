"""User acts to states: the one place where the state changes."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType, TracebackType

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QCloseEvent

from naisr_model.errors import InputError
from naisr_viewer import __version__
from naisr_viewer.control import jobs
from naisr_viewer.control.pictures import write_picture
from naisr_viewer.control.preferences import Preferences
from naisr_viewer.control.preparation import Preparation
from naisr_viewer.control.questions import Questions
from naisr_viewer.control.refinement import Refinement
from naisr_viewer.control.thrift import Thrift
from naisr_viewer.control.timeline import Timeline
from naisr_viewer.control.worker import Worker
from naisr_viewer.engine.atlases import Read
from naisr_viewer.engine.engine import Engine
from naisr_viewer.files.exports import in_the_way, planned
from naisr_viewer.panels.kinds import with_layout_of
from naisr_viewer.panels.scales import fitted_limit, scale_of
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.curves import CurveChoice
from naisr_viewer.state.drawer import Tab
from naisr_viewer.state.explorer import (
    ExplorerState,
    followed,
    opened,
    reset,
    reset_all,
    with_mute,
    with_solo,
    with_values,
)
from naisr_viewer.state.layouts import Layout, Panel
from naisr_viewer.state.overlay import Overlay, Quantity, with_limit
from naisr_viewer.state.patients import Named
from naisr_viewer.state.questions import CLOSE_WINDOW, OPEN_ATLAS
from naisr_viewer.state.requests import ExportChoice, SurfaceResult
from naisr_viewer.state.support import Support
from naisr_viewer.state.theme import ThemeChoice
from naisr_viewer.views.main_window import MainWindow
from naisr_viewer.words.numbers import in_words


class Controller(QObject):
    """One window's life.

    It is long because every act of the user ends here, a method for each; what an act means is in the rooms
    beside it and in the state.

    Args:
        window: shows the state.
        engine: computes surfaces.
        worker: runs the engine beside the window.
        background: does what nobody waits for.
        preferences: recent files, the theme, and what is asked.
        is_attended: whether somebody sits there who can be asked.

    Attributes:
        state: what is being explored.
        refinement: brings the screen to it.
        questions: what is asked before it cannot be taken back.
    """

    travelled = Signal()  # an act was undone or done again
    changed = Signal(object)  # an ExplorerState, after every act: the present one

    def __init__(
        self,
        window: MainWindow,
        engine: Engine,
        worker: Worker,
        background: Worker,
        preferences: Preferences,
        is_attended: bool = True,
    ) -> None:
        super().__init__()
        self.state = ExplorerState()
        self.questions = Questions(window, preferences, is_attended)
        self.refinement = Refinement(window, engine, worker)
        self._preparation = Preparation(window, engine, self.refinement, background)
        self._thrift = Thrift(self.refinement)
        self._window, self._engine, self._preferences = window, engine, preferences
        self._timeline = Timeline(engine)
        self._beside: list[Worker] = []
        self._before_move: ExplorerState | None = None
        self._connect()
        window.show_recent(preferences.recent)
        window.show_theme(preferences.theme)
        window.show_history(False, False)

    @property
    def shown(self) -> Mapping[Panel, SurfaceResult]:
        """What is on screen."""
        return self.refinement.shown

    @property
    def is_busy(self) -> bool:
        """Whether something is being computed that somebody waits for."""
        return self.refinement.is_busy or any(worker.is_busy for worker in self._beside)

    def wait_for(self, worker: Worker) -> None:
        """Count what a worker does beside the surfaces as work that somebody waits for."""
        self._beside.append(worker)

    @property
    def is_moving(self) -> bool:
        """Whether the user is in the middle of changing a covariate."""
        return self._before_move is not None

    def open(self, path: Path) -> None:
        """Read an atlas beside the window and show it at its population mean.

        Where patients are open it is asked, once the file has been found to be an atlas: they belong to the
        one that is left.
        """
        self._window.show_opening(path.name)
        job = jobs.reading_atlas(self._engine, path.absolute())
        self.refinement.run(f"Opening {path.name} …", job, self._show_read)

    def _show_read(self, read: Read) -> None:
        if self.questions.may_lose(OPEN_ATLAS, self.state.patients):
            self.show_atlas(self._engine.begin(read))

    def show_atlas(self, card: AtlasCard, values: Mapping[str, float] = MappingProxyType({})) -> None:
        """Show an atlas that is open in the engine; covariates left out are at their mean."""
        self.begin(with_values(opened(self.state, card), tuple(values.items())))

    def begin(self, state: ExplorerState) -> None:
        """Show an atlas that is open in the engine, as it is in ``state``; nothing lies behind to undo."""
        assert state.atlas is not None
        self._finish_move()
        self._preferences.remember(state.atlas.path)
        self._window.show_recent(self._preferences.recent)
        self._timeline.begin()
        self.go(state)
        self._timeline.release(self.state)

    def export(self, choice: ExportChoice, replaces: bool = False) -> None:
        """Write surfaces at the present values; what is missing is computed first.

        Args:
            choice: what to write and where.
            replaces: whether files that are there already are replaced without a question.
        """
        atlas = self.state.atlas
        if atlas is None:
            return
        plan = planned(self.state, choice)
        if not (replaces or self.questions.may_replace(in_the_way(plan))):
            return
        job = jobs.exporting(self._engine, atlas, plan, choice)
        told = f"Exporting into {choice.folder} …"
        self.refinement.run(told, job, lambda report: self.refinement.tell(report.sentence))

    def save_screenshot(self, path: Path, replaces: bool = False) -> None:
        """Write a picture of the whole window; the ending of ``path`` says which kind.

        Args:
            path: where it goes.
            replaces: whether a file that is there already is replaced without a question.
        """
        if not (replaces or self.questions.may_replace([path] if path.exists() else [])):
            return
        try:
            write_picture(path, self._window.grab_image())
        except InputError as error:
            self._window.show_error(in_words(error))
        else:
            self.refinement.tell(f"Saved {path}")

    def move(self, name: str, value: float) -> None:
        """A covariate is on its way; coarse surfaces follow it."""
        self.move_all(((name, value),))

    def settle(self, name: str, value: float) -> None:
        """A covariate came to rest; what lies behind is one step to undo."""
        self.settle_all(((name, value),))

    def move_all(self, values: Named) -> None:
        """As :meth:`move` for covariates that move together."""
        if self._before_move is None:
            self._before_move = self.state
            self._window.shapes.set_moving(True)
        self.go(self._moved(self._before_move, values))

    def settle_all(self, values: Named) -> None:
        """As :meth:`settle` for covariates that moved together."""
        before = self._before_move or self.state
        self._before_move = None
        self._window.shapes.set_moving(False)
        self.conclude(before, self._moved(before, values))

    def reset(self, name: str) -> None:
        """One covariate to the patient's value, or to the population mean."""
        self.commit(reset(self.state, name))

    def reset_all(self) -> None:
        """All covariates to the patient's values, or to the population mean."""
        self.commit(reset_all(self.state))

    def undo(self) -> None:
        """One act back: of the covariates, or of the patients with their readings and fits."""
        self._finish_move()
        self.go(self._timeline.back(self.state))
        self.travelled.emit()

    def redo(self) -> None:
        """One act forward again."""
        self._finish_move()
        self.go(self._timeline.forward(self.state))
        self.travelled.emit()

    def set_layout(self, layout: Layout) -> None:
        """Show other sub-plots."""
        self.go(replace(self.state, layout=layout))

    def set_drawer(self, tab: Tab | None) -> None:
        """Open a page beneath the shapes; None, or the page that is open, closes it."""
        self.go(replace(self.state, drawer=None if tab is self.state.drawer else tab))

    def set_curve(self, curve: CurveChoice) -> None:
        """Show another curve in the drawer."""
        self.go(replace(self.state, curve=curve))

    def set_quantity(self, quantity: Quantity) -> None:
        """Colour the surfaces by something else."""
        self._see(replace(self.state.overlay, quantity=quantity))

    def set_mute(self, name: str, is_muted: bool) -> None:
        """Leave a covariate out of the full shape, or take it in again."""
        self.go(with_mute(self.state, name, is_muted))

    def set_solo(self, name: str, is_alone: bool) -> None:
        """Leave all other covariates out of the full shape, or take all in again."""
        self.go(with_solo(self.state, name, is_alone))

    def set_shared(self, is_shared: bool) -> None:
        """Whether all surfaces with numbers of one unit share its scale."""
        self._see(replace(self.state.overlay, is_shared=is_shared))

    def set_limit(self, panel: Panel, limit: float) -> None:
        """Move the end of a panel's colour scale."""
        if (scale := scale_of(self.state, panel)) is not None:
            self._see(with_limit(self.state.overlay, scale.key, limit))

    def fit_limit(self, panel: Panel) -> None:
        """Let a panel's colour scale end at the largest number that it shows."""
        limit = fitted_limit(self.state, panel, self.shown)
        if limit is not None:
            self.set_limit(panel, limit)

    def set_follow(self, follow: bool) -> None:
        """Whether the other covariates follow the one that is moved."""
        self.go(replace(self.state, follow=follow))

    def switch_edges(self) -> None:
        """Draw the triangles of the surfaces, or no more."""
        self.go(replace(self.state, has_edges=not self.state.has_edges))

    def set_support(self, support: Support) -> None:
        """Show the data over other covariates, or fold them away."""
        self.go(replace(self.state, support=support))

    def set_theme(self, choice: ThemeChoice) -> None:
        """Colour the window and remember it."""
        self._preferences.set_theme(choice)
        self._window.show_theme(choice)

    def commit(self, state: ExplorerState) -> None:
        """Make ``state`` the present one, as one step to undo."""
        self._finish_move()
        self.conclude(self.state, with_layout_of(state))

    def conclude(self, before: ExplorerState, after: ExplorerState) -> None:
        """Make ``after`` the present state, one step to undo since ``before``."""
        self._timeline.record(before, after)
        self.go(after)
        self._timeline.release(after)

    def go(self, state: ExplorerState) -> None:
        """Make ``state`` the present one, in a layout that its atlas has; nothing is remembered."""
        state = with_layout_of(state)
        if (state.patient, state.person) != (self.state.patient, self.state.person):
            self._finish_move()
        self.state = state
        self._window.show_state(state)
        self._window.show_history(self.is_moving or self._timeline.can_undo, self._timeline.can_redo)
        self._preparation.follow(state)
        self.refinement.follow(state, self.is_moving)
        self.changed.emit(state)

    def report(self, kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        """Show an error that nobody expected in the window; its origin goes to the console."""
        sys.__excepthook__(kind, error, trace)
        self._window.show_error(in_words(error))

    def shutdown(self) -> None:
        """Stop the workers and all timers; nothing happens afterwards."""
        self._preparation.close()
        self._thrift.close()
        self.refinement.close()

    def _connect(self) -> None:
        window = self._window
        window.open_requested.connect(self.open)
        window.export_requested.connect(self.export)
        window.screenshot_requested.connect(self.save_screenshot)
        window.undo_requested.connect(self.undo)
        window.redo_requested.connect(self.redo)
        window.layout_requested.connect(self.set_layout)
        window.covariates.refused.connect(self.refinement.tell)
        window.covariates.mute_toggled.connect(self.set_mute)
        window.covariates.solo_toggled.connect(self.set_solo)
        window.quantity_chosen.connect(self.set_quantity)
        window.shared_toggled.connect(self.set_shared)
        window.shapes.limit_moved.connect(self.set_limit)
        window.shapes.fit_requested.connect(self.fit_limit)
        window.edges_switched.connect(self.switch_edges)
        window.drawer_requested.connect(self.set_drawer)
        window.theme_requested.connect(self.set_theme)
        window.cancel_requested.connect(self.refinement.cancel)
        window.about_requested.connect(lambda: window.show_about(__version__))
        window.preferences_requested.connect(self.questions.change)
        window.close_requested.connect(self._consider_closing)
        window.closing.connect(self.shutdown)
        window.covariates.value_moved.connect(self.move)
        window.covariates.value_settled.connect(self.settle)
        window.covariates.values_moved.connect(self.move_all)
        window.covariates.values_settled.connect(self.settle_all)
        window.covariates.support_requested.connect(self.set_support)
        window.covariates.reset_requested.connect(self.reset)
        window.covariates.reset_all_requested.connect(self.reset_all)
        window.covariates.follow_toggled.connect(self.set_follow)

    def _see(self, overlay: Overlay) -> None:
        self.go(replace(self.state, overlay=overlay))

    def _consider_closing(self, event: QCloseEvent) -> None:
        """Keep the window open where what would be lost is dear to its user."""
        if not self.questions.may_lose(CLOSE_WINDOW, self.state.patients):
            event.ignore()

    def _moved(self, before: ExplorerState, values: Named) -> ExplorerState:
        """Of several that move together the first takes the others along."""
        state = replace(with_values(self.state, values), touched=values[0][0])
        return with_values(followed(state, values[0][0], before.values), values) if state.follow else state

    def _finish_move(self) -> None:
        """Something else comes; a movement that has not come to rest ends where it is."""
        self._window.shapes.set_moving(False)
        self._window.forget_moves()
        if self._before_move is not None:
            before, self._before_move = self._before_move, None
            self._timeline.record(before, self.state)
