"""Where the Tab key goes, and where the focus is after a rest."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

from PySide6.QtWidgets import QWidget
from shiboken6 import isValid


def in_order(stops: Iterable[QWidget]) -> None:
    """Have the Tab key go through ``stops`` as they are read, whenever they were made."""
    for first, second in pairwise(stops):
        QWidget.setTabOrder(first, second)


class FocusRest:
    """Gives the focus back to whatever had it before a part of the window was disabled.

    Qt hands the focus on when its widget is disabled; without this, whoever works with the keyboard would
    begin at the top after each fit.

    Args:
        window: whose focus it is.
    """

    def __init__(self, window: QWidget) -> None:
        self._window = window
        self._had: QWidget | None = None
        self._stand_in: QWidget | None = None

    def begin(self, focused: QWidget | None) -> None:
        """Remember what had the focus, now that it may have lost it; a longer rest has one beginning."""
        if focused is not None and focused is not self._window.focusWidget():
            self._had, self._stand_in = focused, self._window.focusWidget()

    def end(self) -> None:
        """Give the focus back, unless the user has put it elsewhere or nobody could see it there."""
        had, self._had = self._had, None
        is_untouched = self._window.focusWidget() in (None, self._stand_in)
        if had is not None and is_untouched and isValid(had) and had.isVisible() and had.isEnabled():
            had.setFocus()
