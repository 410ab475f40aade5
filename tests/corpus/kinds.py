"""Every case of the corpus."""

from __future__ import annotations

from corpus import meshes, tables
from corpus.case import Case

CASES: tuple[Case, ...] = (*meshes.CASES, *tables.CASES)
