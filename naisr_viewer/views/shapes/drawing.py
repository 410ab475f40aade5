"""How what draws the shapes is brought in: behind the window, because VTK takes a while.

VTK is loaded in a thread. Whatever touches Qt is loaded in the window's thread: now and then the program died
where it was loaded beside a running window.
"""

from __future__ import annotations

import sys
from contextlib import suppress
from importlib import import_module
from threading import Thread
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QSurfaceFormat
from PySide6.QtOpenGLWidgets import QOpenGLWidget
from PySide6.QtWidgets import QWidget

if TYPE_CHECKING:
    from naisr_viewer.views.shapes.canvas import Canvas

DRAWING = "naisr_viewer.views.shapes.canvas"
"""The module that draws, with Qt."""

LIBRARY = "pyvista.plotting"
"""What it draws by: nearly all that takes time, and it knows no Qt."""


def reserve_opengl(widget: QWidget) -> None:
    """Have ``widget`` made for OpenGL; else Qt makes it anew, visibly, when the canvas is added."""
    wanted = QSurfaceFormat()
    wanted.setRenderableType(QSurfaceFormat.RenderableType.OpenGL)
    wanted.setProfile(QSurfaceFormat.OpenGLContextProfile.CoreProfile)
    wanted.setVersion(3, 2)  # the least that VTK draws with
    wanted.setAlphaBufferSize(8)
    QSurfaceFormat.setDefaultFormat(wanted)
    QOpenGLWidget(widget).hide()


class Drawing(QObject):
    """Brings the canvas, from a thread of its own where that takes time.

    Attributes:
        make_canvas: the canvas, or None as long as it is not there.
    """

    arrived = Signal()  # from now on a canvas can be made

    _imported = Signal()  # from the thread: the library has been imported

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self.make_canvas: type[Canvas] | None = None
        self._thread: Thread | None = None
        self._is_closed = False
        self._imported.connect(self._take, Qt.ConnectionType.QueuedConnection)

    def fetch(self) -> None:
        """Bring the canvas, at once where it was imported before."""
        if self._is_closed or self.make_canvas is not None or self._thread is not None:
            return
        if DRAWING in sys.modules:
            self._take()
        else:
            self._thread = Thread(target=self._import, name="naisr-drawing", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Wait for the thread; what it brings is not taken any more."""
        if self._thread is not None:
            self._thread.join()
        self._is_closed, self.make_canvas = True, None

    def _import(self) -> None:
        """In a thread of its own; an error is met again, and told, when the canvas is taken."""
        with suppress(ImportError):
            import_module(LIBRARY)
        self._imported.emit()

    def _take(self) -> None:
        if not self._is_closed:
            self.make_canvas = import_module(DRAWING).Canvas
            self.arrived.emit()
