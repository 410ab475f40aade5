"""Brings what is on screen to a state: coarse while something moves, exact at rest."""

from __future__ import annotations

from dataclasses import replace
from enum import Enum, auto
from typing import TypeVar

from PySide6.QtCore import QObject, QTimer, Signal

from naisr_model.errors import Cancelled
from naisr_viewer.control import jobs
from naisr_viewer.control.worker import Deliver, Job, Worker
from naisr_viewer.engine.engine import Engine
from naisr_viewer.panels.kinds import caption_of, is_there, missing, request_for, shows, visible_panels
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.layouts import Panel
from naisr_viewer.state.requests import EXACT_RESOLUTION, PREVIEW_RESOLUTION, SurfaceRequest, SurfaceResult
from naisr_viewer.views.main_window import MainWindow
from naisr_viewer.words.numbers import in_words
from naisr_viewer.words.status import Situation, status_line

PATIENCE_MS = 1000
"""Work shorter than this shows no progress bar."""

Result = TypeVar("Result")


class Task(Enum):
    """What the worker is busy with."""

    NOTHING = auto()
    PREVIEW = auto()  # coarse surfaces
    EXACT = auto()  # exact ones, which make room for the next change
    UNDIVIDED = auto()  # what is finished, or stopped by the user, before surfaces are computed again


class Refinement(QObject):
    """What is missing on screen, which job runs for it, and what the window says meanwhile.

    Args:
        window: shows the surfaces.
        engine: computes them.
        worker: runs the engine beside the window.
    """

    surface_shown = Signal(object)  # a SurfaceResult that has just come on screen
    settled = Signal()  # everything on screen is exact, or the computation ended otherwise
    rested = Signal()  # as settled, and nobody had anything else to do

    def __init__(self, window: MainWindow, engine: Engine, worker: Worker) -> None:
        super().__init__()
        self.shown: dict[Panel, SurfaceResult] = {}
        self._window, self._engine, self._worker = window, engine, worker
        self._state, self._is_moving = ExplorerState(), False
        self._task = Task.NOTHING
        self._halted = self._notice = ""
        self._errors: list[str] = []
        self._patience = QTimer(self, singleShot=True, interval=PATIENCE_MS)
        self._patience.timeout.connect(lambda: window.show_progress(0.0))
        worker.progressed.connect(self._progressed)
        worker.failed.connect(self._failed)
        worker.idle.connect(self._idle)

    @property
    def is_busy(self) -> bool:
        """Whether the worker has something to do."""
        return self._task is not Task.NOTHING

    @property
    def is_occupied(self) -> bool:
        """Whether the worker does something else than surfaces."""
        return self._task is Task.UNDIVIDED

    def follow(self, state: ExplorerState, is_moving: bool) -> None:
        """Show ``state``; exact surfaces are left for later while the user moves something."""
        is_other_atlas = state.atlas is not self._state.atlas
        self._state, self._is_moving = state, is_moving
        self._halted = self._notice = ""
        if is_other_atlas:
            self.shown = {}
        self._clear_others()
        self._refresh()

    def run(self, status: str, job: Job[Result], then: Deliver[Result]) -> None:
        """Give the worker something else than surfaces to do; the covariates rest meanwhile."""
        self.forget_errors()
        self.go_on(status, job, then)

    def go_on(self, status: str, job: Job[Result], then: Deliver[Result]) -> None:
        """The same for what belongs to an earlier act, whose errors stay to be read."""
        self._window.set_editable(False)
        self._window.show_status(status)
        self._worker.cancel()
        self._start(Task.UNDIVIDED, job, then)

    def forget_errors(self) -> None:
        """Something else is begun; what went wrong before it is history."""
        self._errors = []
        self._window.show_error("")

    def tell(self, notice: str) -> None:
        """Say something in the status line until the next change."""
        self._notice = notice
        self._show_status()

    def cancel(self) -> None:
        """Stop computing and keep what is on screen."""
        if self._task in (Task.PREVIEW, Task.EXACT):
            self._halted = "Stopped"
        else:
            self._notice = "Cancelled"
        self._worker.cancel()

    def close(self) -> None:
        """Stop the worker and the timer; nothing happens afterwards."""
        self._patience.stop()
        self._worker.close()

    def _clear_others(self) -> None:
        """Take surfaces of somebody else, or without a place, from the screen; an empty view is honest."""
        for panel, result in list(self.shown.items()):
            is_gone = not is_there(self._state, panel)
            if is_gone or request_for(self._state, panel, 0).person != result.request.person:
                del self.shown[panel]
                self._window.shapes.clear_surface(panel)

    def _refresh(self) -> None:
        """Show what is remembered and set the worker on what is missing."""
        if self.is_occupied or self._state.atlas is None:
            return
        for resolution in (EXACT_RESOLUTION, PREVIEW_RESOLUTION):
            for request in self._missing(resolution):
                if (result := self._engine.cached(request)) is not None:
                    self._show(result)
        coarse = self._missing(PREVIEW_RESOLUTION)
        fine = [] if self._is_moving else self._missing(EXACT_RESOLUTION)
        if self._task is Task.EXACT or not (coarse or fine):
            self._worker.cancel()
        if coarse:
            self._start(Task.PREVIEW, jobs.frame(self._engine, coarse), self._show_wanted)
        elif fine:
            self._start(Task.EXACT, jobs.one_by_one(self._engine, fine), self._show_wanted)
        self._show_status()

    def _missing(self, resolution: int) -> list[SurfaceRequest]:
        return missing(self._state, self.shown, resolution)

    def _start(self, task: Task, job: Job[Result], then: Deliver[Result]) -> None:
        self._task = task
        if task is Task.PREVIEW:
            self._patience.stop()
            self._window.show_progress(None)
        elif not self._patience.isActive():
            self._patience.start()
        self._worker.submit(job, then)

    def _show_wanted(self, results: jobs.Surfaces) -> None:
        for result in filter(self._is_wanted, results):
            self._show(result)
        self._show_status()

    def _is_wanted(self, result: SurfaceResult) -> bool:
        """Whether a result still belongs on screen; while moving, the way there does too."""
        asked, panel = result.request, result.request.panel
        if panel not in visible_panels(self._state):
            return False
        wanted = request_for(self._state, panel, asked.resolution)
        if shows(self.shown.get(panel), wanted):
            return False
        return asked == (replace(wanted, values=asked.values) if self._is_moving else wanted)

    def _show(self, result: SurfaceResult) -> None:
        panel = result.request.panel
        self.shown[panel] = result
        self._window.shapes.show_surface(result)
        self._window.shapes.set_caption(panel, *caption_of(self._state, result))
        self.surface_shown.emit(result)

    def _progressed(self, fraction: float) -> None:
        if not self._patience.isActive() and self._task is not Task.PREVIEW:
            self._window.show_progress(fraction)

    def _failed(self, error: Exception) -> None:
        if isinstance(error, Cancelled):
            return
        if self.is_occupied:
            self._errors.append(in_words(error))
            self._window.show_error("\n".join(self._errors))
        else:
            self._halted = "Stopped by an error"
            self._window.show_error(in_words(error))

    def _idle(self) -> None:
        was_occupied, self._task = self.is_occupied, Task.NOTHING
        if was_occupied:
            self._window.show_opening("")
            self._window.set_editable(True)
            self._window.show_state(self._state)  # choices that came to nothing are taken back
        if not self._halted:
            self._refresh()
        if self._task is Task.NOTHING:
            self._patience.stop()
            self._window.show_progress(None)
            self._show_status()
            self.settled.emit()
            if not self.is_busy:
                self.rested.emit()

    def _show_status(self) -> None:
        panels = visible_panels(self._state)
        now = Situation(
            views=len(panels),
            results=[self.shown[panel] for panel in panels if panel in self.shown],
            late=len(self._missing(0)),
            is_busy=self.is_busy,
            is_refining=self._task is Task.EXACT,
            halted=self._halted,
            notice=self._notice,
        )
        self._window.show_status(status_line(now))
