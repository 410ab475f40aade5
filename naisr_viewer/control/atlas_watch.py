"""Tells when the file of the open atlas is replaced, as a training does now and then."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtCore import QObject

from naisr_model.files import stamp_of
from naisr_viewer.control.controller import Controller
from naisr_viewer.control.watch import FileWatch


class AtlasWatch(QObject):
    """Watches the file of the atlas that is open.

    Args:
        controller: holds the state; it owns this.
    """

    def __init__(self, controller: Controller) -> None:
        super().__init__(controller)
        self._controller = controller
        self._files = FileWatch(self)
        self._files.touched.connect(self._look)
        controller.refinement.settled.connect(self._look)

    def _look(self) -> None:
        """A file that is gone may be on its way; only another one has changed."""
        state = self._controller.state
        if state.atlas is None:
            return
        is_changed = stamp_of(state.atlas.path) not in (None, state.atlas.written)
        if is_changed != state.is_atlas_changed:
            self._controller.go(replace(state, is_atlas_changed=is_changed))
        self._files.watch([state.atlas.path])
