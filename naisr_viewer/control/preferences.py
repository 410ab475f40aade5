"""What the program remembers of its user from one run to the next."""

from __future__ import annotations

import os
from pathlib import Path

from PySide6.QtCore import QByteArray, QSettings

from naisr_viewer.state.questions import Question
from naisr_viewer.state.theme import ThemeChoice

RECENT_FILES = 8

GEOMETRY = "geometry"
THEME, RECENT, ASKS = "theme", "recent", "asks"
"""Names in the user's settings."""


class Preferences:
    """Recent atlases, the theme, and which questions are asked; what is damaged counts as never said.

    Args:
        settings: where they are kept.
    """

    def __init__(self, settings: QSettings) -> None:
        self._settings = settings

    @property
    def theme(self) -> ThemeChoice:
        """The theme chosen last; the system's before the first choice."""
        stored = self._settings.value(THEME)
        return ThemeChoice(stored) if stored in set(ThemeChoice) else ThemeChoice.SYSTEM

    def set_theme(self, choice: ThemeChoice) -> None:
        """Have it again in the next run."""
        self._settings.setValue(THEME, choice.value)

    @property
    def geometry(self) -> QByteArray:
        """Size and place of the window when it was closed last, as Qt keeps them; empty before that."""
        stored = self._settings.value(GEOMETRY)
        return stored if isinstance(stored, QByteArray) else QByteArray()

    def set_geometry(self, geometry: QByteArray) -> None:
        """Have them again in the next run."""
        self._settings.setValue(GEOMETRY, geometry)

    @property
    def recent(self) -> list[Path]:
        """Files that were opened and still exist, the last one first."""
        stored = self._settings.value(RECENT, [])
        # A list of one comes back from the file as its only text.
        names = stored if isinstance(stored, list) else [stored]
        return [Path(name) for name in names if isinstance(name, str) and os.path.isfile(name)]

    def remember(self, path: Path) -> None:
        """Put a file in front of the recent ones."""
        recent = [path, *(other for other in self.recent if other != path)][:RECENT_FILES]
        self._settings.setValue(RECENT, [str(each) for each in recent])

    def asks(self, question: Question) -> bool:
        """Whether a question is asked; it is until the user wants it no more."""
        return bool(self._settings.value(f"{ASKS}/{question.name}", True, type=bool))

    def set_asks(self, question: Question, is_asked: bool) -> None:
        """Ask it from now on, or no more."""
        self._settings.setValue(f"{ASKS}/{question.name}", is_asked)
