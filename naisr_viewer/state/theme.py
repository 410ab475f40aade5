"""Which theme was asked for."""

from __future__ import annotations

from enum import StrEnum


class ThemeChoice(StrEnum):
    """What the View menu offers."""

    SYSTEM = "system"
    LIGHT = "light"
    DARK = "dark"
