"""Measures in the window: curves along a covariate, and what is usual among the people of the atlas."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from threading import Event

from PySide6.QtCore import QObject

from naisr_model.errors import Cancelled, InputError
from naisr_viewer.control import jobs
from naisr_viewer.control.controller import Controller
from naisr_viewer.control.worker import Worker
from naisr_viewer.engine.engine import Engine
from naisr_viewer.files.curves import in_the_way, write_curve
from naisr_viewer.panels.curves import curve_request, wants_norms
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.curves import NOTHING_RECKONED, CurveRequest, Curves, Reckoning, Standing
from naisr_viewer.state.explorer import ExplorerState, knowing_norms
from naisr_viewer.views.main_window import MainWindow
from naisr_viewer.words.numbers import in_words


class CurveDesk(QObject):
    """Wires the curve in the drawer.

    Args:
        window: shows it.
        controller: holds the state; it owns this.
        engine: measures.
        worker: asks it, while nothing moves; the newest question only.
    """

    def __init__(self, window: MainWindow, controller: Controller, engine: Engine, worker: Worker) -> None:
        super().__init__(controller)
        self._window, self._controller, self._engine, self._worker = window, controller, engine, worker
        self._asked: tuple[CurveRequest, bool] | None = None
        self._found: Curves | None = None
        window.curve_requested.connect(controller.set_curve)
        window.curve_place_chosen.connect(self.save)
        window.closing.connect(worker.close)
        controller.changed.connect(self.follow)
        controller.wait_for(worker)
        worker.failed.connect(self._failed)

    def follow(self, state: ExplorerState) -> None:
        """Have the curve measured anew where what it depends on is elsewhere, once that rests."""
        request = curve_request(state)
        wanted = None if request is None else (request, state.has_norms)
        if wanted == self._asked:
            return
        self._worker.cancel()  # nothing shall slow the hand
        self._asked = None if self._controller.is_moving else wanted
        if self._asked is not None:
            self._ask(self._asked[0])

    def save(self, path: Path, replaces: bool = False) -> None:
        """Write the curve that is shown into a file, whose ending says how, and a record beside it.

        Args:
            path: where it goes.
            replaces: whether files that are there already are replaced without a question.
        """
        controller, found = self._controller, self._found
        if found is None or not (replaces or controller.questions.may_replace(in_the_way(path))):
            return
        try:
            write_curve(path, found, controller.state, self._window.curve_picture)
        except InputError as error:
            self._window.show_error(in_words(error))
        else:
            controller.refinement.tell(f"Saved {path}")

    def _ask(self, request: CurveRequest) -> None:
        if self._found is not None and self._found.request.atlas != request.atlas:
            self._found = None
        self._window.show_curves(self._found, is_measuring=True)
        self._worker.submit(jobs.measuring(self._engine, request), self._show)

    def _show(self, curves: Curves) -> None:
        self._found = curves
        self._window.show_curves(curves)

    def _failed(self, error: Exception) -> None:
        if not isinstance(error, Cancelled):
            self._found = None
            self._window.show_curves(None, trouble=in_words(error))


class NormsDesk(QObject):
    """Has it worked out what is usual once anything is compared with it, and where the patient stands.

    Args:
        window: shows it.
        controller: holds the state; it owns this.
        engine: works it out.
        worker: has it do so, while the user's hand is at rest.
    """

    def __init__(self, window: MainWindow, controller: Controller, engine: Engine, worker: Worker) -> None:
        super().__init__(controller)
        self._window, self._controller, self._engine, self._worker = window, controller, engine, worker
        self._at_rest = Event()
        self._atlas: AtlasCard | None = None
        self._begun = False
        self._placed: tuple[Path, int] | None = None
        window.reckoning_requested.connect(self.set_wanted)
        window.closing.connect(worker.close)
        controller.changed.connect(self.follow)
        controller.refinement.rested.connect(lambda: self.follow(controller.state))
        controller.wait_for(worker)
        worker.progressed.connect(self._progressed)
        worker.failed.connect(self._failed)

    def follow(self, state: ExplorerState) -> None:
        """Begin where it is wanted, once nobody waits for anything else."""
        if state.atlas is not self._atlas:
            self._leave(state.atlas)
        if self._controller.is_moving:
            self._at_rest.clear()
            return
        self._at_rest.set()
        if state.has_norms:
            self._place(state)
        elif wants_norms(state) and not (self._begun or self._controller.refinement.is_busy):
            self.set_wanted(True)

    def set_wanted(self, is_wanted: bool) -> None:
        """Begin to work it out, or stop doing so; that has to be begun again by hand."""
        atlas, self._begun = self._controller.state.atlas, True
        if not is_wanted or atlas is None:
            self._worker.cancel()
            self._window.show_reckoning(Reckoning(can_begin=True))
        else:
            self._window.show_reckoning(Reckoning(share=0.0))
            job = jobs.reckoning(self._engine, atlas.path, self._at_rest)
            self._worker.submit(job, lambda _: self._know())

    def _leave(self, atlas: AtlasCard | None) -> None:
        """Another atlas has other people."""
        self._atlas, self._begun, self._placed = atlas, False, None
        self._worker.cancel()
        self._window.show_reckoning(NOTHING_RECKONED)
        self._window.show_standings(())

    def _know(self) -> None:
        self._begun = False  # who comes back to the atlas learns it at once
        self._window.show_reckoning(NOTHING_RECKONED)
        self._controller.go(knowing_norms(self._controller.state))

    def _place(self, state: ExplorerState) -> None:
        """Have it found where the patient that is shown stands."""
        assert state.atlas is not None
        wanted = (state.atlas.path, state.person if state.can_forecast else 0)
        if wanted != self._placed:
            self._placed = wanted
            self._window.show_standings(())
            if wanted[1]:
                self._worker.submit(jobs.standing(self._engine, *wanted), partial(self._tell, wanted))

    def _tell(self, wanted: tuple[Path, int], found: tuple[Standing, ...]) -> None:
        if wanted == self._placed:
            self._window.show_standings(found)

    def _progressed(self, share: float) -> None:
        if not self._controller.state.has_norms:
            self._window.show_reckoning(Reckoning(share=share))

    def _failed(self, error: Exception) -> None:
        if not isinstance(error, Cancelled):
            self._window.show_reckoning(Reckoning(trouble=in_words(error)))
