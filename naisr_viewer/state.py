"""What is being explored, as frozen values and pure functions that make the next value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from naisr_model.covariates import Covariate, Population

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

UNDO_DEPTH = 200
"""How many covariate changes are remembered."""

EDGE_OF_DATA = 0.98
"""A combination lonelier than this share of the population counts as unseen."""

NEIGHBOURS = 3
"""How many subjects must be near a combination for it to count as seen."""

LEAST_SPREAD = 0.05
"""Combinations closer than this (standard deviations) to a subject are always seen."""

Values = tuple[float, ...]
"""Real covariate values in the atlas's covariate order."""

Named = tuple[tuple[str, float], ...]
"""Real covariate values by name, hashable."""


class Layout(StrEnum):
    """How the sub-plots share the window."""

    SIDE_BY_SIDE = "side by side"
    FULL_SHAPE = "full shape"


@dataclass(frozen=True)
class Panel:
    """One sub-plot: the template, the shape moved by one covariate alone, or the full shape."""

    kind: Literal["template", "effect", "shape"]
    covariate: str = ""


TEMPLATE = Panel("template")
FULL_SHAPE = Panel("shape")


@dataclass(frozen=True)
class AtlasCard:
    """All that the window needs to know of an open atlas.

    Attributes:
        path: the file it was read from.
        name: for example ``airway``.
        covariates: the sliders, in order.
        population: real values of the subjects behind the atlas, for the histograms.
    """

    path: Path
    name: str
    covariates: tuple[Covariate, ...]
    population: Population

    @property
    def centre(self) -> Values:
        """The population mean, where every slider starts."""
        return tuple(covariate.centre for covariate in self.covariates)

    def index(self, name: str) -> int:
        """Position of a covariate; ``ValueError`` for an unknown name."""
        return [covariate.name for covariate in self.covariates].index(name)


@dataclass(frozen=True)
class ExplorerState:
    """The whole visible situation apart from the camera.

    Attributes:
        atlas: the open atlas, or None before the first one.
        values: real covariate values in the atlas's order.
        layout: which sub-plots are on screen.
    """

    atlas: AtlasCard | None = None
    values: Values = ()
    layout: Layout = Layout.SIDE_BY_SIDE

    @property
    def named(self) -> Named:
        """The covariate values with their names."""
        names = [covariate.name for covariate in self.atlas.covariates] if self.atlas else []
        return tuple(zip(names, self.values, strict=True))


def opened(state: ExplorerState, atlas: AtlasCard) -> ExplorerState:
    """``atlas`` at its population mean."""
    return replace(state, atlas=atlas, values=atlas.centre)


def with_value(state: ExplorerState, name: str, value: float) -> ExplorerState:
    """One covariate moved to ``value`` (real units), held inside the observed range."""
    assert state.atlas is not None
    index = state.atlas.index(name)
    low, high = state.atlas.covariates[index].range
    held = min(max(value, low), high)
    return replace(state, values=(*state.values[:index], held, *state.values[index + 1 :]))


def with_centre(state: ExplorerState, name: str) -> ExplorerState:
    """One covariate back at the population mean."""
    assert state.atlas is not None
    return with_value(state, name, state.atlas.covariates[state.atlas.index(name)].centre)


def with_all_centred(state: ExplorerState) -> ExplorerState:
    """Every covariate back at the population mean."""
    return replace(state, values=state.atlas.centre) if state.atlas else state


def all_panels(atlas: AtlasCard) -> tuple[Panel, ...]:
    """Template, one panel per covariate, full shape: the order on screen."""
    effects = (Panel("effect", covariate.name) for covariate in atlas.covariates)
    return (TEMPLATE, *effects, FULL_SHAPE)


def visible_panels(state: ExplorerState) -> tuple[Panel, ...]:
    """The panels of the present layout; none without an atlas."""
    if state.atlas is None:
        return ()
    return (FULL_SHAPE,) if state.layout is Layout.FULL_SHAPE else all_panels(state.atlas)


def panel_values(state: ExplorerState, panel: Panel) -> Named:
    """The covariate values that ``panel`` depends on, and no others."""
    if panel.kind == "effect":
        return tuple(item for item in state.named if item[0] == panel.covariate)
    return state.named if panel.kind == "shape" else ()


def changed_panels(old: ExplorerState, new: ExplorerState) -> tuple[Panel, ...]:
    """The panels on screen in ``new`` whose surface differs from that in ``old``."""
    if old.atlas is not new.atlas:
        return visible_panels(new)
    before = set(visible_panels(old))
    return tuple(
        panel
        for panel in visible_panels(new)
        if panel not in before or panel_values(old, panel) != panel_values(new, panel)
    )


def label(name: str) -> str:
    """A covariate's name as people read it: ``body_weight`` is ``Body weight``."""
    words = name.replace("_", " ").strip()
    return words[:1].upper() + words[1:]


def panel_title(panel: Panel) -> str:
    """What stands above a sub-plot."""
    titles = {"template": "Template", "shape": "Full shape"}
    return titles.get(panel.kind) or f"{label(panel.covariate)} only"


def is_seen(population: Population, values: Mapping[str, float]) -> bool:
    """Whether people like ``values`` are among the subjects behind the atlas.

    Compares the distance to the :data:`NEIGHBOURS`-th nearest training row, over the continuous
    covariates in units of their spread, with the same distance of the rows among themselves.

    Args:
        population: the subjects.
        values: real values by name; a missing covariate is at its mean.
    """
    measured = [covariate for covariate in population.covariates if covariate.kind == "continuous"]
    if not measured or np.count_nonzero(~population.held_out) <= NEIGHBOURS:
        return True
    tree, usual = _neighbourhood(population)
    here = [float(c.normalise(values.get(c.name, c.centre))) for c in measured]
    return bool(tree.query(here, k=[NEIGHBOURS])[0][0] <= usual)


@lru_cache(maxsize=4)
def _neighbourhood(population: Population) -> tuple[cKDTree, float]:
    """The training rows for look-up, and how far their neighbours are at the edge of the data."""
    from scipy.spatial import cKDTree  # here, because it would slow down --help

    columns = [i for i, covariate in enumerate(population.covariates) if covariate.kind == "continuous"]
    rows = population.normalised()[~population.held_out][:, columns]
    tree = cKDTree(rows)
    distances = tree.query(rows, k=[NEIGHBOURS + 1])[0]  # one more: every row is its own nearest
    return tree, max(float(np.quantile(distances, EDGE_OF_DATA)), LEAST_SPREAD)


@dataclass(frozen=True)
class History:
    """Covariate values before and after the present ones, nearest last."""

    past: tuple[Values, ...] = ()
    future: tuple[Values, ...] = ()


def record(history: History, before: Values, now: Values) -> History:
    """Remember ``before``, unless nothing changed; what had been undone is forgotten."""
    if before == now:
        return history
    return History((*history.past, before)[-UNDO_DEPTH:], ())


def undo(history: History, now: Values) -> tuple[History, Values]:
    """One step back, or no step where there is none."""
    if not history.past:
        return history, now
    return History(history.past[:-1], (*history.future, now)), history.past[-1]


def redo(history: History, now: Values) -> tuple[History, Values]:
    """One step forward again, or no step where there is none."""
    if not history.future:
        return history, now
    return History((*history.past, now), history.future[:-1]), history.future[-1]
