"""Every case of the corpus."""

from __future__ import annotations

from corpus import checkpoints, clouds, landmarks, meshes, options, settings, stores, tables, volumes, window
from corpus.case import Case

KINDS = (
    *(meshes, volumes, clouds, tables, landmarks),
    *(checkpoints, stores, settings, options, window),
)

CASES: tuple[Case, ...] = tuple(case for kind in KINDS for case in kind.CASES)
