"""Every case of the corpus."""

from __future__ import annotations

from corpus import (
    checkpoints,
    clouds,
    landmarks,
    meshes,
    options,
    sessions,
    settings,
    stores,
    tables,
    volumes,
    window,
)
from corpus.case import Case

TITLES = {
    "mesh": "meshes",
    "volume": "label volumes",
    "cloud": "clouds of points",
    "table": "tables and what they name",
    "landmarks": "landmarks",
    "checkpoint": "atlases",
    "store": "prepared stores",
    "state": "half-done trainings",
    "settings": "settings of a training",
    "options": "options",
    "session": "sessions of the window",
    "window": "files opened in the window",
}
"""What is damaged, by kind of case."""

_MODULES = (
    *(meshes, volumes, clouds, tables, landmarks),
    *(checkpoints, stores, settings, options, sessions, window),
)

CASES: tuple[Case, ...] = tuple(case for module in _MODULES for case in module.CASES)
