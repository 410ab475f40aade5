"""Pinned places: a click becomes a pin, and what moved the pins is told as the shapes change."""

from __future__ import annotations

from functools import partial

from PySide6.QtCore import QObject

from naisr_model.errors import Cancelled
from naisr_viewer.control import jobs
from naisr_viewer.control.controller import Controller
from naisr_viewer.control.worker import Worker
from naisr_viewer.engine.engine import Engine
from naisr_viewer.panels.pins import can_pin, ledger_request
from naisr_viewer.state.explorer import ExplorerState, pinned, without_pin, without_pins
from naisr_viewer.state.layouts import Panel
from naisr_viewer.state.pins import Ledger, LedgerRequest, Point
from naisr_viewer.state.requests import SurfaceResult
from naisr_viewer.views.main_window import MainWindow
from naisr_viewer.words.numbers import in_words


class PinDesk(QObject):
    """Wires clicks on shapes and the ledger.

    Args:
        window: shows the pins.
        controller: holds the state; it owns this.
        engine: finds material points.
        finder: finds the one that was clicked.
        teller: tells what moved them; the newest question only.
    """

    def __init__(
        self, window: MainWindow, controller: Controller, engine: Engine, finder: Worker, teller: Worker
    ) -> None:
        super().__init__(controller)
        self._window, self._controller, self._engine = window, controller, engine
        self._finder, self._teller = finder, teller
        self._asked: LedgerRequest | None = None
        window.shapes.clicked.connect(self.pin)
        window.unpin_requested.connect(self.unpin)
        window.pin_removal_requested.connect(self.unpin_one)
        window.closing.connect(self.close)
        controller.changed.connect(self.follow)
        for worker in (finder, teller):
            worker.failed.connect(self._failed)
            controller.wait_for(worker)

    def pin(self, panel: Panel, point_mm: Point) -> None:
        """Mark the material point at a point of the surface that is shown in ``panel``."""
        surface = self._controller.shown.get(panel)
        if surface is not None and can_pin(self._controller.state, panel):
            job = jobs.pinning(self._engine, surface.request, point_mm)
            self._finder.submit(job, partial(self._pin, surface))

    def unpin(self) -> None:
        """Take all pins away."""
        self._controller.commit(without_pins(self._controller.state))

    def unpin_one(self, number: int) -> None:
        """Take one pin away."""
        self._controller.commit(without_pin(self._controller.state, number))

    def follow(self, state: ExplorerState) -> None:
        """Tell of the pins as the shapes are now."""
        request = ledger_request(state)
        if request == self._asked:
            return
        self._asked = request
        if request is None:
            self._window.show_ledger(None)
        else:
            self._teller.submit(jobs.telling(self._engine, request), self._tell)

    def close(self) -> None:
        """Stop the workers; nothing happens afterwards."""
        self._finder.close()
        self._teller.close()

    def _pin(self, surface: SurfaceResult, origin_mm: Point) -> None:
        """Unless another atlas was opened meanwhile."""
        state = self._controller.state
        if state.atlas is not None and state.atlas.path == surface.request.atlas:
            self._controller.commit(pinned(state, origin_mm))

    def _tell(self, ledger: Ledger) -> None:
        """Of the pins that there are; on the way, of where the shapes have just been."""
        if self._asked is not None and ledger.request.pins == self._asked.pins:
            self._window.show_ledger(ledger)

    def _failed(self, error: Exception) -> None:
        if not isinstance(error, Cancelled):
            self._window.show_error(f"The pinned place cannot be told of: {in_words(error)}")
