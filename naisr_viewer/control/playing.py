"""A covariate that moves by itself, like a hand on its slider."""

from __future__ import annotations

import time

from PySide6.QtCore import QObject, QTimer

from naisr_viewer.control.controller import Controller
from naisr_viewer.state.sweep import Sweep, sweep_of
from naisr_viewer.views.main_window import MainWindow

SWEEP_S = 4.0
"""From one end of the observed range to the other."""

FRAME_MS = 40


class Player(QObject):
    """Moves a covariate, chosen or the last moved, to and fro until it is stopped: one step to undo.

    Previews follow as they do a slider that is dragged: what comes too late is left out.

    Args:
        window: asks for it, and shows that it plays.
        controller: holds the state; it owns this.
    """

    def __init__(self, window: MainWindow, controller: Controller) -> None:
        super().__init__(controller)
        self._window, self._controller = window, controller
        self._sweep: Sweep | None = None
        self._began_s = 0.0
        self._frames = QTimer(self, interval=FRAME_MS)
        self._frames.timeout.connect(self._step)
        window.play_requested.connect(self.toggle)
        window.covariates.play_clicked.connect(self.toggle)
        window.covariates.value_moved.connect(self._give_way)  # the user takes over
        window.covariates.values_moved.connect(self._give_way)
        window.closing.connect(self._give_way)

    def toggle(self, name: str = "") -> None:
        """Begin where a covariate is, or end where it has come to; one that plays gives way to another.

        Args:
            name: of the covariate; of the one that plays, else of the one moved last, when left out.
        """
        playing = self._sweep
        if playing is not None:
            self._end(playing)
        if playing is None or name not in ("", playing.covariate.name):
            self._begin(name)

    def _begin(self, name: str) -> None:
        self._sweep, self._began_s = sweep_of(self._controller.state, name), time.monotonic()
        if self._sweep is not None:
            self._controller.move(self._sweep.covariate.name, self._sweep.after(0))
            self._frames.start()
        self._window.show_playing("" if self._sweep is None else self._sweep.covariate.name)

    def _step(self) -> None:
        sweep, controller = self._sweep, self._controller
        if sweep is None or not controller.is_moving:  # another act has ended the movement
            self._give_way()
        elif controller.refinement.is_occupied:
            self._end(sweep)
        else:
            sweeps = (time.monotonic() - self._began_s) / SWEEP_S
            controller.move(sweep.covariate.name, sweep.after(sweeps))

    def _end(self, sweep: Sweep) -> None:
        self._give_way()
        name = sweep.covariate.name
        self._controller.settle(name, dict(self._controller.state.named)[name])

    def _give_way(self, *_: object) -> None:
        self._frames.stop()
        self._sweep = None
        self._window.show_playing("")
