"""What is measured, and how much of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from naisr_model.atlas import Atlas
from naisr_model.benchmark.paper_size import paper_sized
from naisr_model.progress import SILENT, Progress


@dataclass(frozen=True)
class Scope:
    """How much is measured.

    Attributes:
        resolutions: for exact surfaces against dense ones; the first is also the one that is timed alone.
        growth: resolutions between which the growth of the evaluations is measured.
        memory: resolution of the surface whose memory is measured.
        repeats: runs behind every median.
        shapes: shapes in a training batch.
        training: the preset whose networks and batch the training step has.
        frames: positions of a slider along its range.
        people: how many of the population's covariates the preview is compared at.
        viewer_runs: starts of the window, the first of which warms the file caches and fills the viewer's.
        enlarged: whether the atlas is measured at the paper's network size instead of its own.
    """

    resolutions: tuple[int, ...] = (128, 256)
    growth: tuple[int, int] = (64, 512)
    memory: int = 512
    repeats: int = 3
    shapes: int = 8
    training: str = "paper-airway"
    frames: int = 40
    people: int = 30
    viewer_runs: int = 3
    enlarged: bool = True


QUICK = Scope(
    resolutions=(32, 48),
    growth=(32, 64),
    memory=64,
    repeats=1,
    shapes=2,
    training="demo",
    frames=3,
    people=3,
    viewer_runs=1,
    enlarged=False,
)
"""Enough to see that everything runs; its figures say little."""


@dataclass(frozen=True, eq=False)
class Subject:
    """What is measured.

    Attributes:
        path: the atlas's file.
        atlas: as it is.
        scope: how much.
        progress: asked between the parts of a measurement whether anybody waits.
    """

    path: Path
    atlas: Atlas
    scope: Scope
    progress: Progress = SILENT

    @cached_property
    def sized(self) -> Atlas:
        """The same atlas at the network size that is measured."""
        return paper_sized(self.atlas) if self.scope.enlarged else self.atlas

    @cached_property
    def people(self) -> NDArray[np.intp]:
        """Rows of the training population, evenly spaced."""
        rows = np.flatnonzero(~self.atlas.population.held_out)
        return rows[np.unique(np.linspace(0, len(rows) - 1, self.scope.people).astype(int))]

    @property
    def few(self) -> list[int]:
        """As many of them as runs are to be made, from one end of the population to the other."""
        chosen = np.linspace(0, len(self.people) - 1, self.scope.repeats + 2).astype(int)[1:-1]
        return [int(row) for row in self.people[chosen]]


def size(scope: Scope) -> str:
    """The network size that is measured, in words."""
    return "the paper's network size" if scope.enlarged else "the atlas's own network size"


def latent(atlas: Atlas, row: int) -> NDArray[np.float32]:
    """The code ``[L]`` of one row of the training population."""
    return atlas.checkpoint.latents[np.flatnonzero(~atlas.population.held_out).tolist().index(row)]
