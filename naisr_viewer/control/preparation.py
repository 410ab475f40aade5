"""Makes previews fast in the background, once everything that somebody waits for is done."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QObject, Qt

from naisr_model.errors import Cancelled
from naisr_viewer.control import jobs
from naisr_viewer.control.refinement import Refinement
from naisr_viewer.control.worker import Worker
from naisr_viewer.engine.engine import Engine
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.views.main_window import MainWindow
from naisr_viewer.words.numbers import in_words


class Preparation(QObject):
    """Prepares the previews of whoever is shown.

    Args:
        window: tells when a picture is on the screen.
        engine: tabulates.
        refinement: tells when it is at rest.
        worker: does what nobody waits for.
    """

    def __init__(self, window: MainWindow, engine: Engine, refinement: Refinement, worker: Worker) -> None:
        super().__init__()
        self._window, self._engine, self._refinement, self._worker = window, engine, refinement, worker
        self._state = ExplorerState()
        self._begun: tuple[Path, int] | None = None
        # Queued, so that the picture has reached the screen before the networks' import slows it down.
        window.shapes.drawn.connect(lambda _: self._begin(), Qt.ConnectionType.QueuedConnection)
        refinement.rested.connect(self._begin)
        worker.failed.connect(self._failed)

    def follow(self, state: ExplorerState) -> None:
        """Prepare for ``state``, sooner or later; an atlas that was opened anew needs it again."""
        if state.atlas is not self._state.atlas:
            self._begun = None
        self._state = state

    def close(self) -> None:
        """Stop the worker; nothing happens afterwards."""
        self._worker.close()

    def _begin(self) -> None:
        atlas, person = self._state.atlas, self._state.person
        if atlas is None or self._refinement.is_busy or not self._window.shapes.is_ready:
            return
        if self._begun == (atlas.path, person):
            return
        self._begun = (atlas.path, person)
        if not self._engine.has_previews(atlas.path, person):
            self._worker.cancel()
            self._worker.submit(jobs.preparing(self._engine, atlas.path, person), lambda _: None)

    def _failed(self, error: Exception) -> None:
        if not isinstance(error, Cancelled):
            self._window.show_error(f"Previews stay coarse: {in_words(error)}")
