"""Where the files are that come with the program."""

from __future__ import annotations

from pathlib import Path
from types import MappingProxyType

from naisr_model.errors import InputError

_ROOT = Path(__file__).parents[1]
_PLACES = (_ROOT / "resources", _ROOT / "naisr_viewer" / "_resources")
"""In a checkout, and in an installation."""


ATLASES = MappingProxyType(
    {
        "airway": "Airways of children",
        "bodies": "Bodies of all ages",
        "starman": "Little men in the plane",
    }
)
"""The atlases that come with the program, by the names of their files, and what they are of."""


def shipped(name: str) -> Path:
    """A file or folder that comes with the program, as ``docs/glossary.md``.

    Raises:
        InputError: when it was not installed.
    """
    found = next((place / name for place in _PLACES if (place / name).exists()), None)
    if found is None:
        raise InputError(f"{name}, which comes with the program, is not installed; install it again")
    return found


def shipped_atlas(name: str = "airway") -> Path:
    """One of the :data:`ATLASES` that come with the program.

    Raises:
        InputError: when it was not installed.
    """
    return shipped(f"{name}.safetensors")
