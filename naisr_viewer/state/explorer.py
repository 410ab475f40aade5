"""What is being explored, as frozen values and pure functions that make the next value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from naisr_model.covariates import Covariate, Population, growth_path
from naisr_viewer.state.patients import Fitted, Named, Patient

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


class Layout(StrEnum):
    """How the sub-plots share the window."""

    SIDE_BY_SIDE = "side by side"
    FULL_SHAPE = "full shape"
    FIT = "fit"
    CHANGE = "before and after"


@dataclass(frozen=True)
class Panel:
    """One sub-plot.

    The template, the shape moved by one covariate alone, or the full shape; and of a patient the scan
    with its distance to the full shape, the full shape with its uncertainty, the shape that is compared
    with (before), and the full shape with its change since then.
    """

    kind: Literal["template", "effect", "shape", "scan", "certainty", "before", "change"]
    covariate: str = ""


TEMPLATE = Panel("template")
FULL_SHAPE = Panel("shape")
SCAN = Panel("scan")
CERTAINTY = Panel("certainty")
BEFORE = Panel("before")
CHANGE = Panel("change")

OF_A_PATIENT = {
    Layout.FIT: (FULL_SHAPE, SCAN, CERTAINTY),
    Layout.CHANGE: (BEFORE, FULL_SHAPE, CHANGE),
}
"""Layouts that need a fitted patient, and what they show."""


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
        follow: whether the other covariates follow one that is moved, as they do in the population.
        patients: the scans that are open.
        patient: key of the one that is shown; None for the population average.
        compared: key of the one that is compared with; None for the patient as fitted.
        has_ghost: whether the scan is drawn over the full shape.
    """

    atlas: AtlasCard | None = None
    values: Values = ()
    layout: Layout = Layout.SIDE_BY_SIDE
    follow: bool = False
    patients: tuple[Patient, ...] = ()
    patient: int | None = None
    compared: int | None = None
    has_ghost: bool = True

    @property
    def named(self) -> Named:
        """The covariate values with their names."""
        return self.with_names(self.values)

    @property
    def shown(self) -> Patient | None:
        """The patient that is shown."""
        return self.find(self.patient)

    @property
    def fit(self) -> Fitted | None:
        """The fit of the patient that is shown."""
        return self.shown.fit if self.shown else None

    @property
    def reference(self) -> Fitted | None:
        """The fit that is compared with."""
        other = self.find(self.compared)
        return (other and other.fit) or self.fit

    @property
    def person(self) -> int:
        """Whose code the surfaces have; 0 for the population average."""
        return self.fit.person if self.fit else 0

    @property
    def home(self) -> Values:
        """Where the covariates are reset to: the patient's, or the population mean."""
        if self.fit is not None:
            return tuple(value for _, value in self.fit.values)
        return self.atlas.centre if self.atlas else ()

    def find(self, key: int | None) -> Patient | None:
        """An open patient; None where there is none with this key."""
        return next((each for each in self.patients if each.key == key), None)

    def with_names(self, values: Values) -> Named:
        """Values in the atlas's order with their names."""
        names = [covariate.name for covariate in self.atlas.covariates] if self.atlas else []
        return tuple(zip(names, values, strict=True))


def opened(state: ExplorerState, atlas: AtlasCard) -> ExplorerState:
    """``atlas`` at its population mean, without patients."""
    layout = Layout.SIDE_BY_SIDE if state.layout in OF_A_PATIENT else state.layout
    return ExplorerState(atlas, atlas.centre, layout, follow=state.follow, has_ghost=state.has_ghost)


def with_value(state: ExplorerState, name: str, value: float) -> ExplorerState:
    """One covariate moved to ``value`` (real units), held inside the observed range."""
    assert state.atlas is not None
    index = state.atlas.index(name)
    low, high = state.atlas.covariates[index].range
    held = min(max(value, low), high)
    return replace(state, values=(*state.values[:index], held, *state.values[index + 1 :]))


def followed(state: ExplorerState, name: str, start: Values) -> ExplorerState:
    """The other continuous covariates moved along with ``name``, as in the population.

    What each was off the population's path at ``start``, where the movement began, it stays.
    """
    assert state.atlas is not None
    index = state.atlas.index(name)
    path = growth_path(state.atlas.population, name, np.array([start[index], state.values[index]]))
    result = state
    for i, covariate in enumerate(state.atlas.covariates):
        if i != index and covariate.kind == "continuous":
            result = with_value(result, covariate.name, start[i] + float(path[1, i] - path[0, i]))
    return result


def reset(state: ExplorerState, name: str) -> ExplorerState:
    """One covariate back home."""
    assert state.atlas is not None
    return with_value(state, name, state.home[state.atlas.index(name)])


def reset_all(state: ExplorerState) -> ExplorerState:
    """Every covariate back home."""
    return replace(state, values=state.home)


def with_patient(state: ExplorerState, patient: Patient) -> ExplorerState:
    """A patient opened, or changed where the key is known, and shown."""
    others = [each for each in state.patients if each.key != patient.key]
    patients = tuple(sorted((*others, patient), key=lambda each: each.key))
    return showing(replace(state, patients=patients), patient.key)


def without_patient(state: ExplorerState, key: int) -> ExplorerState:
    """A patient closed; the last of the others is shown."""
    rest = tuple(each for each in state.patients if each.key != key)
    compared = None if state.compared == key else state.compared
    state = replace(state, patients=rest, compared=compared)
    return showing(state, rest[-1].key if rest else None) if state.patient == key else state


def showing(state: ExplorerState, key: int | None) -> ExplorerState:
    """Another patient, at what is known or found of them; None for the population average."""
    state = replace(state, patient=key)
    if state.fit is None and state.layout in OF_A_PATIENT:
        state = replace(state, layout=Layout.SIDE_BY_SIDE)
    state = replace(state, values=state.home)
    for name, value in state.shown.known if state.shown and not state.fit else ():
        state = with_value(state, name, value)
    return state


def all_panels(atlas: AtlasCard) -> tuple[Panel, ...]:
    """Template, one panel per covariate, full shape: the order on screen."""
    effects = (Panel("effect", covariate.name) for covariate in atlas.covariates)
    return (TEMPLATE, *effects, FULL_SHAPE)


def visible_panels(state: ExplorerState) -> tuple[Panel, ...]:
    """The panels of the present layout; none without an atlas."""
    if state.atlas is None:
        return ()
    if state.layout in OF_A_PATIENT:
        return OF_A_PATIENT[state.layout]
    return (FULL_SHAPE,) if state.layout is Layout.FULL_SHAPE else all_panels(state.atlas)


def panel_values(state: ExplorerState, panel: Panel) -> Named:
    """The covariate values that ``panel`` depends on, and no others."""
    match panel.kind:
        case "template":
            return ()
        case "effect":
            return tuple(item for item in state.named if item[0] == panel.covariate)
        case "before":
            return state.reference.values if state.reference else ()
        case _:
            return state.named


def label(name: str) -> str:
    """A covariate's name as people read it: ``body_weight`` is ``Body weight``."""
    words = name.replace("_", " ").strip()
    return words[:1].upper() + words[1:]


def panel_title(panel: Panel) -> str:
    """What stands above a sub-plot."""
    titles = {
        "template": "Template",
        "shape": "Full shape",
        "scan": "Scan",
        "certainty": "Uncertainty",
        "before": "Before",
        "change": "Change",
    }
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
    rows, usual = _neighbourhood(population)
    here = np.array([float(c.normalise(values.get(c.name, c.centre))) for c in measured])
    return _loneliness(rows, here, NEIGHBOURS) <= usual


@lru_cache(maxsize=4)
def _neighbourhood(population: Population) -> tuple[NDArray[np.float64], float]:
    """The training rows, and how far their neighbours are at the edge of the data."""
    columns = [i for i, covariate in enumerate(population.covariates) if covariate.kind == "continuous"]
    rows = population.normalised()[~population.held_out][:, columns]
    # One more: every row is its own nearest. By hand, because SciPy would delay the first picture.
    distances = [_loneliness(rows, row, NEIGHBOURS + 1) for row in rows]
    return rows, max(float(np.quantile(distances, EDGE_OF_DATA)), LEAST_SPREAD)


def _loneliness(rows: NDArray[np.float64], here: NDArray[np.float64], neighbours: int) -> float:
    """Distance of ``here [N]`` to its so manieth nearest of ``rows [n, N]``."""
    squared = np.square(rows - here).sum(axis=1)
    return float(np.sqrt(np.partition(squared, neighbours - 1)[neighbours - 1]))


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
