"""Tells when another program writes a file that is open."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from PySide6.QtCore import QFileSystemWatcher, QObject, Signal


class FileWatch(QObject):
    """Watches files, and their folders: a new file is news of its folder."""

    touched = Signal()  # something happened to one of the files, or beside it

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self._files = QFileSystemWatcher(self)
        self._files.fileChanged.connect(lambda _: self.touched.emit())
        self._files.directoryChanged.connect(lambda _: self.touched.emit())

    def watch(self, paths: Iterable[Path]) -> None:
        """Watch these files and no others."""
        wanted = {str(place) for path in paths for place in (path, path.parent) if place.exists()}
        watched = {*self._files.files(), *self._files.directories()}
        if watched - wanted:
            self._files.removePaths(list(watched - wanted))
        if wanted - watched:
            self._files.addPaths(list(wanted - watched))
