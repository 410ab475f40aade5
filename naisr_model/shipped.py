"""Where the atlas is that comes with the program."""

from __future__ import annotations

from pathlib import Path

from naisr_model.errors import InputError

_ROOT = Path(__file__).parents[1]
_PLACES = (_ROOT / "resources", _ROOT / "naisr_viewer" / "_resources")
"""In a checkout, and in an installation."""


def shipped_atlas() -> Path:
    """The airway atlas that comes with the program.

    Raises:
        InputError: when it was not installed.
    """
    files = [place / "airway.safetensors" for place in _PLACES]
    found = next((file for file in files if file.is_file()), None)
    if found is None:
        raise InputError("the shipped airway atlas is not installed; give the path of an atlas")
    return found
