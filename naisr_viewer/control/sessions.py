"""Sessions: saved and opened by the user, and kept from one run to the next."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from PySide6.QtCore import QObject, QTimer

from naisr_model.errors import Cancelled, InputError
from naisr_model.progress import SILENT
from naisr_viewer.control import jobs
from naisr_viewer.control.controller import Controller
from naisr_viewer.control.worker import Job, Worker
from naisr_viewer.engine.clinic import Clinic
from naisr_viewer.engine.engine import Engine
from naisr_viewer.engine.sessions import Restored
from naisr_viewer.files.sessions import read_session
from naisr_viewer.state.questions import OPEN_ATLAS
from naisr_viewer.state.session import session_of, state_of
from naisr_viewer.views.main_window import MainWindow
from naisr_viewer.words.numbers import in_words

QUIET_MS = 2000
"""After the last act, before what is on screen is kept."""

LEFT = "left"
"""What the kept session of the run before is called."""


class SessionDesk(QObject):
    """Wires sessions.

    Args:
        window: shows what they hold.
        controller: holds the state; it owns this.
        engine: knows the files and the people.
        clinic: reads and fits.
        writer: writes what the user saves.
        keeper: writes what is kept.
        kept: where what is on screen is kept for the next run; None where nobody comes back.
    """

    def __init__(
        self,
        window: MainWindow,
        controller: Controller,
        engine: Engine,
        clinic: Clinic,
        writer: Worker,
        keeper: Worker,
        kept: Path | None,
    ) -> None:
        super().__init__(controller)
        self._window, self._controller, self._engine, self._clinic = window, controller, engine, clinic
        self._writer, self._keeper, self._kept = writer, keeper, kept
        self._left = None if kept is None else kept.with_stem(LEFT)
        self._patience = QTimer(self, singleShot=True, interval=QUIET_MS)
        self._patience.timeout.connect(self._keep)
        window.session_requested.connect(self.open)
        window.session_place_chosen.connect(self.save)
        window.going_on_requested.connect(self.go_on)
        window.closing.connect(self.close)
        writer.failed.connect(self._failed)
        keeper.failed.connect(self._failed_to_keep)
        controller.wait_for(writer)
        if kept is not None:
            controller.changed.connect(lambda _: self._patience.start())
            self._put_aside(kept, kept.with_stem(LEFT))

    def open(self, path: Path) -> None:
        """Bring back what a session had on screen; what is open makes room for it."""
        controller = self._controller
        try:
            session = read_session(path.absolute())
        except InputError as error:
            self._failed(error)
            return
        if controller.questions.may_lose(OPEN_ATLAS, controller.state.patients):
            job = jobs.restoring(self._engine, self._clinic, session)
            controller.refinement.run(f"Opening {path.name} …", job, self._show)

    def go_on(self) -> None:
        """Bring back what was on screen at the end of the run before."""
        if self._left is not None:
            self.open(self._left)

    def save(self, path: Path, replaces: bool = False) -> None:
        """Write what is on screen into a file.

        Args:
            path: where it goes.
            replaces: whether a file that is there already is replaced without a question.
        """
        controller = self._controller
        if controller.state.atlas is None:
            return
        if replaces or controller.questions.may_replace([path] if path.exists() else []):
            self._writer.submit(self._saving(path), lambda path: controller.refinement.tell(f"Saved {path}"))

    def close(self) -> None:
        """Keep what is on screen and stop; nothing happens afterwards."""
        self._patience.stop()
        self._writer.close()
        self._keeper.close()
        if self._kept is not None and self._controller.state.atlas is not None:
            with suppress(InputError, Cancelled):  # nobody is there to be told
                self._saving(self._kept)(lambda _: None, SILENT)

    def _show(self, restored: Restored) -> None:
        session = restored.session
        self._controller.begin(state_of(session, restored.card, restored.patients))
        if session.camera is not None:
            self._window.shapes.set_camera(session.camera)
        if restored.notes:
            self._window.show_error("\n".join(restored.notes))

    def _saving(self, path: Path) -> Job[Path]:
        state, size = self._controller.state, self._window.size()
        session = session_of(state, self._window.shapes.camera, (size.width(), size.height()))
        persons = [each.fit.person if each.fit else 0 for each in state.patients]
        return jobs.saving(self._engine, session, persons, path)

    def _keep(self) -> None:
        if self._kept is not None and self._controller.state.atlas is not None:
            self._keeper.submit(self._saving(self._kept), lambda _: None)

    def _put_aside(self, kept: Path, left: Path) -> None:
        """What the run before kept, so that this one does not write over it."""
        with suppress(OSError):
            os.replace(kept, left)
        self._window.show_left(left.is_file())

    def _failed(self, error: Exception) -> None:
        if not isinstance(error, Cancelled):
            self._window.show_error(in_words(error))

    def _failed_to_keep(self, error: Exception) -> None:
        """Said once: it would fail again with the next act."""
        if not isinstance(error, Cancelled):
            self._kept = None
            self._window.show_error(f"What is on screen is not kept for the next time: {in_words(error)}")
