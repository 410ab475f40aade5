"""Where the search for unknown covariates begins."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from naisr_model.learning.fitting.least_squares import Problem, evaluate, linearise
from naisr_model.learning.fitting.target import Sample

Vector = NDArray[np.float64]

STARTS, PLACING_POINTS, PURSUED = 12, 128, 3
"""Places over the population at which unknown covariates are tried, on so many surface points, and how many
of the best are pursued: a big child and a small adult are both good explanations until one looks closer."""


def combinations(known: Vector, binary: Sequence[int]) -> list[Vector]:
    """``known`` with every choice of levels of the unknown binary covariates."""
    unknown = [column for column in binary if np.isnan(known[column])]
    result = []
    for levels in itertools.product((-1.0, 1.0), repeat=len(unknown)):
        fixed = known.copy()
        fixed[unknown] = levels
        result.append(fixed)
    return result


def starts(problem: Problem, sample: Sample) -> list[Vector]:
    """The most probable of some places over the population, the code being 0; the best first."""
    places = [np.concatenate([row, np.zeros(len(problem.prior.code_root))]) for row in spread(problem)]
    rows = [evaluate(problem, sample, place) for place in places]
    noise = min(one.noise for one in rows)
    scores = [linearise(problem, *pair, noise).objective for pair in zip(rows, places, strict=True)]
    return [places[number] for number in np.argsort(scores)[:PURSUED]]


def spread(problem: Problem) -> list[Vector]:
    """Free covariates of training rows: one in the middle, then always the farthest from those before."""
    free = problem.free
    if not len(free):
        return [np.zeros(0)]
    rows = problem.prior.training[:, free]
    distances = np.linalg.norm(rows - problem.prior.mean[free], axis=1)
    chosen = [int(distances.argmin())]
    nearest = np.linalg.norm(rows - rows[chosen[0]], axis=1)
    while len(chosen) < STARTS and nearest.max() > 0:
        chosen.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, np.linalg.norm(rows - rows[chosen[-1]], axis=1))
    return list(rows[chosen])
