"""Where the files are that come with the program."""

from __future__ import annotations

from pathlib import Path

from naisr_model.errors import InputError

_ROOT = Path(__file__).parents[1]
_PLACES = (_ROOT / "resources", _ROOT / "naisr_viewer" / "_resources")
"""In a checkout, and in an installation."""


def shipped(name: str) -> Path:
    """A file or folder that comes with the program, as ``docs/glossary.md``.

    Raises:
        InputError: when it was not installed.
    """
    found = next((place / name for place in _PLACES if (place / name).exists()), None)
    if found is None:
        raise InputError(f"{name}, which comes with the program, is not installed; install it again")
    return found


def shipped_atlas() -> Path:
    """The airway atlas that comes with the program.

    Raises:
        InputError: when it was not installed.
    """
    return shipped("airway.safetensors")
