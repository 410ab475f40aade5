"""Where the window stands on the screen, and where it stood last time."""

from __future__ import annotations

from PySide6.QtCore import QSize

from naisr_viewer.control.preferences import Preferences
from naisr_viewer.views.main_window import FIRST_SIZE, MainWindow

FRAME = QSize(8, 40)
"""What a window manager puts around a window, at most."""


def place(window: MainWindow, pixels: tuple[int, int] | None, preferences: Preferences) -> None:
    """Give the window its size and place, and remember them when it closes.

    Args:
        window: still hidden.
        pixels: width and height that were asked for; None for those of the last time, or at first as much
            as the screen has of the usual ones.
        preferences: where they are kept.
    """
    if pixels is not None:
        window.resize(*pixels)
    elif not window.restoreGeometry(preferences.geometry):
        window.resize(FIRST_SIZE.boundedTo(window.screen().availableSize() - FRAME))
    window.closing.connect(lambda: preferences.set_geometry(window.saveGeometry()))
