"""The only wiring: user acts to states, states to requests, results to the window."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from enum import Enum, auto
from pathlib import Path
from types import MappingProxyType, TracebackType

from PySide6.QtCore import QObject, QSettings, Qt, QTimer, Signal

from naisr_model.errors import Cancelled, InputError
from naisr_viewer import __version__
from naisr_viewer.control import jobs
from naisr_viewer.control.jobs import ExportReport
from naisr_viewer.control.preferences import Preferences
from naisr_viewer.control.worker import Job, Worker
from naisr_viewer.engine.engine import Engine
from naisr_viewer.files import surfaces
from naisr_viewer.state.explorer import (
    AtlasCard,
    ExplorerState,
    History,
    Layout,
    Panel,
    followed,
    opened,
    record,
    redo,
    reset,
    reset_all,
    undo,
    visible_panels,
    with_value,
)
from naisr_viewer.state.requests import (
    EXACT_RESOLUTION,
    PREVIEW_RESOLUTION,
    ExportChoice,
    SurfaceResult,
    answers,
    missing,
    request_for,
)
from naisr_viewer.state.theme import ThemeChoice
from naisr_viewer.views.main_window import MainWindow
from naisr_viewer.words.captions import caption
from naisr_viewer.words.numbers import in_words
from naisr_viewer.words.status import status_line

PATIENCE_MS = 1000
"""Work shorter than this shows no progress bar."""


class Task(Enum):
    """What the worker is busy with."""

    NOTHING = auto()
    OPENING = auto()
    PREVIEW = auto()
    EXACT = auto()
    EXPORT = auto()
    READING = auto()
    FITTING = auto()


UNDIVIDED = (Task.OPENING, Task.EXPORT, Task.READING, Task.FITTING)
"""What the worker finishes, or is told to stop, before it computes surfaces again."""


class Controller(QObject):
    """One window's life.

    Args:
        window: shows the state.
        engine: computes surfaces.
        worker: runs the engine beside the window.
        background: does what nobody waits for.
        settings: remembers recent files and the theme.
    """

    settled = Signal()  # everything on screen is exact, or the computation ended otherwise
    produced = Signal(object)  # a job that was started from outside handed this over

    def __init__(
        self, window: MainWindow, engine: Engine, worker: Worker, background: Worker, settings: QSettings
    ) -> None:
        super().__init__()
        self.state = ExplorerState()
        self.shown: dict[Panel, SurfaceResult] = {}
        self._window, self._engine, self._preferences = window, engine, Preferences(settings)
        self._worker, self._background = worker, background
        self._history = History()
        self._before_move: ExplorerState | None = None
        self._task = Task.NOTHING
        self._halted = ""
        self._notice = ""
        self._preparing: tuple[Path, int] | None = None
        self._patience = QTimer(self, singleShot=True, interval=PATIENCE_MS)
        self._connect()
        window.show_recent(self._preferences.recent)
        window.show_theme(self._preferences.theme)
        window.show_history(False, False)

    @property
    def is_moving(self) -> bool:
        """Whether the user is in the middle of changing a covariate."""
        return self._before_move is not None

    @property
    def is_occupied(self) -> bool:
        """Whether the worker does something else than surfaces."""
        return self._task in UNDIVIDED

    @property
    def is_busy(self) -> bool:
        """Whether the worker has something to do."""
        return self._task is not Task.NOTHING

    def open(self, path: Path) -> None:
        """Read an atlas beside the window and show it at its population mean."""
        self._window.show_opening(path.name)
        self.run(Task.OPENING, f"Opening {path.name} …", jobs.opening(self._engine, path.absolute()))

    def run(self, task: Task, status: str, job: Job) -> None:
        """Give the worker something else than surfaces to do; the covariates rest meanwhile."""
        self._window.show_error("")
        self._window.set_editable(False)
        self._window.show_status(status)
        self._start(task, job)

    def show_atlas(self, card: AtlasCard, values: Mapping[str, float] = MappingProxyType({})) -> None:
        """Show an atlas that is open in the engine; covariates left out are at their mean."""
        self.shown = {}
        self._preparing = None
        self._leave()
        self._preferences.remember(card.path)
        self._window.show_recent(self._preferences.recent)
        state = opened(self.state, card)
        for name, value in values.items():
            state = with_value(state, name, value)
        self.go(state)

    def export(self, choice: ExportChoice) -> None:
        """Write surfaces at the present values; what is missing is computed first."""
        if self.state.atlas is not None:
            job = jobs.exporting(self._engine, self.state, choice)
            self.run(Task.EXPORT, f"Exporting into {choice.folder} …", job)

    def save_screenshot(self, path: Path) -> None:
        """Write a picture of the whole window; the ending of ``path`` says which kind."""
        image = self._window.grab_image()

        def write(place: Path) -> None:
            if not image.save(str(place)):
                raise InputError(f"cannot write a picture to {path}; end its name with .png")

        try:
            surfaces.write_atomically(path, write)
        except InputError as error:
            self._window.show_error(in_words(error))
        else:
            self._notice = f"Saved {path}"
            self._show_status()

    def move(self, name: str, value: float) -> None:
        """A covariate is on its way; coarse surfaces follow it."""
        if self._before_move is None:
            self._before_move = self.state
            self._window.shapes.set_moving(True)
        self.go(self._moved(self._before_move, name, value))

    def settle(self, name: str, value: float) -> None:
        """A covariate came to rest; what lies behind is one step to undo."""
        before = self._before_move or self.state
        self._before_move = None
        self._window.shapes.set_moving(False)
        self._commit(before, self._moved(before, name, value))

    def reset(self, name: str) -> None:
        """One covariate to the patient's value, or to the population mean."""
        self._commit(self.state, reset(self.state, name))

    def reset_all(self) -> None:
        """All covariates to the patient's values, or to the population mean."""
        self._commit(self.state, reset_all(self.state))

    def undo(self) -> None:
        """One change of the covariates back."""
        self._travel(*undo(self._history, self.state.values))

    def redo(self) -> None:
        """One change of the covariates forward again."""
        self._travel(*redo(self._history, self.state.values))

    def set_layout(self, layout: Layout) -> None:
        """Show other sub-plots."""
        self.go(replace(self.state, layout=layout))

    def set_follow(self, follow: bool) -> None:
        """Whether the other covariates follow the one that is moved."""
        self.go(replace(self.state, follow=follow))

    def set_theme(self, choice: ThemeChoice) -> None:
        """Colour the window and remember it."""
        self._preferences.set_theme(choice)
        self._window.show_theme(choice)

    def cancel(self) -> None:
        """Stop computing and keep what is on screen."""
        if self._task in (Task.PREVIEW, Task.EXACT):
            self._halted = "Stopped"
        else:
            self._notice = "Cancelled"
        self._worker.cancel()

    def report(self, kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        """Show an error that nobody expected in the window; its origin goes to the console."""
        sys.__excepthook__(kind, error, trace)
        self._window.show_error(in_words(error))

    def shutdown(self) -> None:
        """Stop the workers and all timers; nothing happens afterwards."""
        self._patience.stop()
        self._background.close()
        self._worker.close()

    def _connect(self) -> None:
        window, worker = self._window, self._worker
        window.open_requested.connect(self.open)
        window.export_requested.connect(self.export)
        window.screenshot_requested.connect(self.save_screenshot)
        window.undo_requested.connect(self.undo)
        window.redo_requested.connect(self.redo)
        window.layout_requested.connect(self.set_layout)
        window.theme_requested.connect(self.set_theme)
        window.cancel_requested.connect(self.cancel)
        window.about_requested.connect(lambda: window.show_about(__version__))
        window.closing.connect(self.shutdown)
        # Queued, so that the picture has reached the screen before the networks' import slows it down.
        window.shapes.drawn.connect(lambda _: self._prepare_previews(), Qt.ConnectionType.QueuedConnection)
        window.covariates.value_moved.connect(self.move)
        window.covariates.value_settled.connect(self.settle)
        window.covariates.reset_requested.connect(self.reset)
        window.covariates.reset_all_requested.connect(self.reset_all)
        window.covariates.follow_toggled.connect(self.set_follow)
        worker.delivered.connect(self._delivered)
        worker.progressed.connect(self._progressed)
        worker.failed.connect(self._failed)
        worker.idle.connect(self._idle)
        self._background.failed.connect(self._background_failed)
        self._patience.timeout.connect(lambda: self._window.show_progress(0.0))

    def _commit(self, before: ExplorerState, after: ExplorerState) -> None:
        self._history = record(self._history, before.values, after.values)
        self.go(after)

    def _travel(self, history: History, values: tuple[float, ...]) -> None:
        self._history = history
        self.go(replace(self.state, values=values))

    def _moved(self, before: ExplorerState, name: str, value: float) -> ExplorerState:
        state = with_value(self.state, name, value)
        return followed(state, name, before.values) if state.follow else state

    def go(self, state: ExplorerState) -> None:
        """Make ``state`` the present one."""
        if (state.patient, state.person) != (self.state.patient, self.state.person):
            self._leave()
        self.state = state
        self._halted = self._notice = ""
        self._window.show_state(state)
        self._clear_others()
        self._window.show_history(bool(self._history.past), bool(self._history.future))
        self._refresh()

    def _leave(self) -> None:
        """Another patient or atlas comes; what was done to the covariates so far ends here."""
        self._history = History()
        self._before_move = None
        self._window.shapes.set_moving(False)
        self._window.covariates.forget_moves()

    def _clear_others(self) -> None:
        """Take surfaces of somebody else from the screen; an empty view is honest."""
        for panel, result in list(self.shown.items()):
            wanted = request_for(self.state, panel, 0)
            if wanted.person != result.request.person:
                del self.shown[panel]
                self._window.shapes.clear_surface(panel)

    def _refresh(self) -> None:
        """Show what is remembered and set the worker on what is missing."""
        if self._task in UNDIVIDED or self.state.atlas is None:
            return
        for resolution in (EXACT_RESOLUTION, PREVIEW_RESOLUTION):
            for request in missing(self.state, self.shown, resolution):
                if (result := self._engine.cached(request)) is not None:
                    self._show(result)
        coarse = missing(self.state, self.shown, PREVIEW_RESOLUTION)
        fine = [] if self.is_moving else missing(self.state, self.shown, EXACT_RESOLUTION)
        if self._task is Task.EXACT or not (coarse or fine):
            self._worker.cancel()
        if coarse:
            self._start(Task.PREVIEW, jobs.frame(self._engine, coarse))
        elif fine:
            self._start(Task.EXACT, jobs.one_by_one(self._engine, fine))
        self._show_status()

    def _prepare_previews(self) -> None:
        """Make previews of the open atlas fast, once everything that somebody waits for is done."""
        atlas, person = self.state.atlas, self.state.person
        if atlas is None or self.is_busy or not self._window.shapes.is_ready:
            return
        if self._preparing == (atlas.path, person):
            return
        self._preparing = (atlas.path, person)
        if self._engine.has_previews(atlas.path, person):
            return
        self._background.cancel()
        self._background.submit(jobs.preparing(self._engine, atlas.path, person))

    def _start(self, task: Task, job: Job) -> None:
        if task in UNDIVIDED:
            self._worker.cancel()
        self._task = task
        if task is Task.PREVIEW:
            self._patience.stop()
            self._window.show_progress(None)
        elif not self._patience.isActive():
            self._patience.start()
        self._worker.submit(job)

    def _delivered(self, item: object) -> None:
        if isinstance(item, AtlasCard):
            self.show_atlas(item)
        elif isinstance(item, ExportReport):
            self._notice = item.sentence
        elif isinstance(item, tuple):
            for result in filter(self._is_wanted, item):
                self._show(result)
            self._show_status()
        else:
            self.produced.emit(item)

    def _is_wanted(self, result: SurfaceResult) -> bool:
        """Whether a result still belongs on screen; while moving, the way there does too."""
        asked, panel = result.request, result.request.panel
        if panel not in visible_panels(self.state):
            return False
        wanted = request_for(self.state, panel, asked.resolution)
        if answers(self.shown.get(panel), wanted):
            return False
        return asked == (replace(wanted, values=asked.values) if self.is_moving else wanted)

    def _show(self, result: SurfaceResult) -> None:
        panel = result.request.panel
        self.shown[panel] = result
        self._window.shapes.show_surface(result)
        self._window.shapes.set_caption(panel, *caption(self.state, result))

    def _progressed(self, fraction: float) -> None:
        if not self._patience.isActive() and self._task is not Task.PREVIEW:
            self._window.show_progress(fraction)

    def _failed(self, error: Exception) -> None:
        if isinstance(error, Cancelled):
            return
        if self._task in (Task.PREVIEW, Task.EXACT):
            self._halted = "Stopped by an error"
        self._window.show_error(in_words(error))

    def _background_failed(self, error: Exception) -> None:
        if not isinstance(error, Cancelled):
            self._window.show_error(f"Previews stay coarse: {in_words(error)}")

    def _idle(self) -> None:
        was, self._task = self._task, Task.NOTHING
        if was is Task.OPENING:
            self._window.show_opening("")
        if was in UNDIVIDED:
            self._window.set_editable(True)
            self._window.show_state(self.state)  # choices that came to nothing are taken back
        if not self._halted:
            self._refresh()
        if self._task is Task.NOTHING:
            self._patience.stop()
            self._window.show_progress(None)
            self._show_status()
            self.settled.emit()
            self._prepare_previews()

    def _show_status(self) -> None:
        text = status_line(
            self.state,
            self.shown,
            is_busy=self.is_busy,
            is_refining=self._task is Task.EXACT,
            halted=self._halted,
            notice=self._notice,
        )
        self._window.show_status(text)
