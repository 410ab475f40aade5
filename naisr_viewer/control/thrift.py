"""Gives memory back once the window has rested for a while: a day's work takes no more than an hour's."""

from __future__ import annotations

import ctypes
import gc
import sys

from PySide6.QtCore import QObject, QTimer

from naisr_viewer.control.refinement import Refinement

REST_MS = 1000
"""So long nothing happens before anything is given back: it takes some hundredths of a second."""

BUSY_MS = 5000
"""So often what is new is looked through meanwhile: it takes some milliseconds."""

YOUNG = 1
"""The older of the collector's two generations of new objects."""


class Thrift(QObject):
    """Collects what nobody refers to and hands free memory back to the system.

    A mesh and what belongs to it refer to each other, so only the garbage collector frees them. By itself it
    would run in whichever thread makes an object, and a closed dialog must not be deleted by a worker: so it
    is off, and runs here, in the window's thread.

    Args:
        refinement: tells when it is at rest, and whether it still is.
    """

    def __init__(self, refinement: Refinement) -> None:
        super().__init__(refinement)
        self._refinement, self._modules = refinement, 0
        self._rest = QTimer(self, singleShot=True, interval=REST_MS)
        self._rest.timeout.connect(self._give_back)
        refinement.rested.connect(self._rest.start)
        self._meanwhile = QTimer(self, interval=BUSY_MS)
        self._meanwhile.timeout.connect(lambda: gc.collect(YOUNG))
        self._meanwhile.start()

    def close(self) -> None:
        """Nothing happens afterwards."""
        self._rest.stop()
        self._meanwhile.stop()

    def _give_back(self) -> None:
        if self._refinement.is_busy:
            return
        gc.collect()
        if len(sys.modules) != self._modules:  # what libraries made as they were loaded stays: looked at once
            gc.freeze()
            self._modules = len(sys.modules)
        give_free_memory_back()


def give_free_memory_back() -> None:
    """Where the C library is glibc, which else keeps freed memory; nothing elsewhere."""
    if sys.platform == "linux" and (trim := getattr(ctypes.CDLL(None), "malloc_trim", None)) is not None:
        trim(0)
