"""Where the data behind an atlas are, seen over two of its covariates."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from naisr_model.covariates import Covariate, Values
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.patients import Fitted, OpenScan

EDGE_CELLS = 64
"""Along each axis, at whose corners it is asked how far the people behind the atlas are."""

OUTLINE_POINTS = 73
WITHIN_95 = 5.991465
"""A pair of Gaussian numbers is within this many squared deviations of its mean with 95 %: -2 log 0.05."""

Line = NDArray[np.float64]
"""Places of real values, ``[k, 2]``."""


@dataclass(frozen=True)
class Support:
    """Which two covariates are shown against each other, and whether they are.

    Attributes:
        x: name of the one along; empty where an atlas has no two.
        y: name of the one upwards.
        is_open: whether the user wants to see it; None where nobody has said, and room decides.
    """

    x: str = ""
    y: str = ""
    is_open: bool | None = None


NOTHING_CHOSEN = Support()


@dataclass(frozen=True, eq=False)
class Visits:
    """The people that an atlas was made from.

    Attributes:
        places: real values over the two covariates, the visits of one subject behind each other, ``[n, 2]``.
        subjects: number of the subject of each, ``[n]``.
    """

    places: Line
    subjects: NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Remoteness:
    """How far the people behind an atlas are over the two covariates; the data end at 1.

    Attributes:
        x: real values of the columns.
        y: real values of the rows.
        values: ``[len(y), len(x)]``.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    values: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Mark:
    """A patient over the two covariates.

    Attributes:
        key: of the patient.
        name: what the list shows.
        place: real values.
        outlines: around where the patient is with 95 %, as far as that was inferred.
    """

    key: int
    name: str
    place: tuple[float, float]
    outlines: tuple[Line, ...] = ()


def suited(support: Support, atlas: AtlasCard) -> Support:
    """``support`` for an atlas: as it was where that has both covariates, else over the first that there are.

    Continuous covariates come before binary ones.
    """
    names = [covariate.name for covariate in atlas.covariates]
    if support.x in names and support.y in names and support.x != support.y:
        return support
    first = sorted(atlas.covariates, key=lambda covariate: covariate.kind == "binary")
    x, y = [*(covariate.name for covariate in first), "", ""][:2]
    return replace(support, x=x if y else "", y=y)


def with_axis(support: Support, axis: Literal["x", "y"], name: str) -> Support:
    """Another covariate along an axis; the two change places where it was along the other one."""
    if name == (support.y if axis == "x" else support.x):
        return replace(support, x=support.y, y=support.x)
    return replace(support, x=name) if axis == "x" else replace(support, y=name)


def axes_of(support: Support, atlas: AtlasCard) -> tuple[Covariate, Covariate]:
    """The two covariates."""
    return atlas.covariates[atlas.index(support.x)], atlas.covariates[atlas.index(support.y)]


def visits_of(support: Support, atlas: AtlasCard) -> Visits:
    """Whom the atlas was trained on, in the order of its table."""
    population = atlas.population
    rows = np.flatnonzero(~population.held_out)
    numbers = {subject: number for number, subject in enumerate(dict.fromkeys(population.subjects))}
    subjects = np.array([numbers[population.subjects[row]] for row in rows], np.intp)
    order = np.argsort(subjects, kind="stable")
    columns = [atlas.index(support.x), atlas.index(support.y)]
    return Visits(population.values[rows[order]][:, columns], subjects[order])


def remoteness(support: Support, atlas: AtlasCard, values: Values) -> Remoteness:
    """How far people are over the ranges of the two covariates, the others being as in ``values``."""
    x, y = (np.linspace(*covariate.range, EDGE_CELLS + 1) for covariate in axes_of(support, atlas))
    places = np.tile([values[covariate.name] for covariate in atlas.covariates], (len(x) * len(y), 1))
    places[:, atlas.index(support.x)] = np.tile(x, len(y))
    places[:, atlas.index(support.y)] = np.repeat(y, len(x))
    return Remoteness(x, y, atlas.population.remoteness(places).reshape(len(y), len(x)))


def marks_of(support: Support, patients: tuple[OpenScan, ...]) -> tuple[Mark, ...]:
    """The patients of whom both covariates are known or were found."""
    return tuple(mark for patient in patients if (mark := _mark(support, patient)) is not None)


def _mark(support: Support, patient: OpenScan) -> Mark | None:
    fit = patient.fit if patient.fit is not None and patient.fit.is_valid else None
    values = dict(patient.known if fit is None else fit.values)
    if support.x not in values or support.y not in values:
        return None
    place = values[support.x], values[support.y]
    return Mark(patient.key, patient.name, place, () if fit is None else outlines(support, fit))


def outlines(support: Support, fit: Fitted) -> tuple[Line, ...]:
    """Around where a fitted patient is with 95 %.

    Of two continuous covariates that were inferred it is the ellipse of their covariance; else the interval
    of each that was inferred; none where both were known.
    """
    values, covariances = dict(fit.values), {(a, b): value for a, b, value in fit.covariances}
    x, y = support.x, support.y
    if (x, y) in covariances or (y, x) in covariances:
        across = covariances.get((x, y), covariances.get((y, x)))
        spread = np.array([[covariances[x, x], across], [across, covariances[y, y]]], np.float64)
        return (_ellipse(np.array([values[x], values[y]]), spread),)
    intervals = {name: (low, high) for name, low, high in fit.intervals}
    along = [np.array([(end, values[y]) for end in intervals[x]])] if x in intervals else []
    upwards = [np.array([(values[x], end) for end in intervals[y]])] if y in intervals else []
    return (*along, *upwards)


def _ellipse(mean: NDArray[np.float64], covariance: NDArray[np.float64]) -> Line:
    """All places where (p - mean) covariance^-1 (p - mean) is :data:`WITHIN_95`."""
    lengths, directions = np.linalg.eigh(covariance)
    angles = np.linspace(0.0, 2 * np.pi, OUTLINE_POINTS)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    scaled = circle * np.sqrt(WITHIN_95 * lengths.clip(0.0))
    return np.asarray(mean + scaled @ directions.T)
