"""Fitting a code and the unknown covariates to a given shape with the networks fixed, in some seconds.

Least squares on first-order distances (:mod:`~naisr_model.learning.fitting.least_squares`), begun all over
the population; :mod:`~naisr_model.learning.fitting.paper` is what it is measured against.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from naisr_model.learning.fitting.evidence import SHARES, ShapeFit, shape_fit
from naisr_model.learning.fitting.least_squares import (
    FOLLOWED_POINTS,
    INDEPENDENT_POINTS,
    TOLERATED,
    Descent,
    Problem,
    Quadratic,
    descend,
    linearise,
)
from naisr_model.learning.fitting.prior import Prior
from naisr_model.learning.fitting.rescue import rescued
from naisr_model.learning.fitting.starts import PLACING_POINTS, combinations, starts
from naisr_model.learning.fitting.target import Sample, Target, draw_sample
from naisr_model.models.base import ShapeModel
from naisr_model.progress import SILENT, Progress

Vector = NDArray[np.float64]

STAGES, MOST_STEPS = (256, 512, 768), 4
"""Surface points of each stage, freshly drawn and from coarse to fine, and its most steps."""

DRAWN_IN = (4 * TOLERATED, 2 * TOLERATED, TOLERATED)
"""k of each stage where all covariates are known: a limb that is off by its own width is first drawn in; at
once held for something that the atlas does not know, it would stay where it is."""

HOPELESS = 25.0
"""Twice the log odds against an explanation at which it is pursued no further."""

APART = 4.0
"""Squared distance of the covariates, in standard deviations, from which on two explanations are two."""

Explanation = tuple[Problem, Descent]
"""What is given of the covariates, and where a descent on the rest ended."""


def fit_shape(
    model: ShapeModel,
    target: Target,
    prior: Prior,
    known: Vector,
    binary: Sequence[int] = (),
    *,
    progress: Progress = SILENT,
) -> list[ShapeFit]:
    """The most probable code and unknown covariates of a shape, the maximum of p(c, z | points).

    Unknown covariates stay inside their observed range. A binary covariate has two levels and
    nothing between them, so each is fitted.

    Args:
        model: trained, not changed.
        target: samples of the shape.
        prior: of the training population.
        known: centred covariates, NaN where unknown, ``[N]``.
        binary: columns that only ever are -1 or +1.
        progress: told the finished share, checked before every step.

    Returns:
        A fit for each explanation that differs in its covariates, the best first.

    Raises:
        Cancelled: when nobody waits for it any more.
    """
    samples = [draw_sample(target, points, stage) for stage, points in enumerate(STAGES)]
    if not np.isnan(known).any():
        problem = Problem(model, prior, known, FOLLOWED_POINTS)
        problems = [dataclasses.replace(problem, tolerated=tolerated) for tolerated in DRAWN_IN]
        descent = _descend(problems, samples, np.zeros(len(prior.code_root)), progress)
        return [shape_fit(problem, descent, descent.rows.noise, samples[0])]
    begun = _begun(model, target, prior, combinations(known, binary), progress.part(0, 1 / 3))
    settled: list[Explanation] = []
    pursued = _different(begun)
    for (followed, descent), piece in progress.part(1 / 3, 2 / 3).over(pursued):
        problem = _weighed(followed)
        settled.append((problem, _descend([problem] * 2, samples[1:], descent.parameters, piece)))
    noise = min(descent.rows.noise for _, descent in settled)
    fits = sorted(
        (shape_fit(*one, noise, samples[0]) for one in _different(settled)), key=lambda fit: fit.surprise
    )
    best = _followed(model, prior, fits[0], samples[-1], progress.part(2 / 3, 1))
    asked = len(fits) * (1 + len(SHARES) * len(fits[0].free)) * len(samples[0].points)
    spent = sum(descent.evaluations for _, descent in begun + settled) + best.evaluations + asked
    return [dataclasses.replace(best, evaluations=spent), *fits[1:]]


def _begun(
    model: ShapeModel,
    target: Target,
    prior: Prior,
    choices: Sequence[Vector],
    progress: Progress,
) -> list[Explanation]:
    """Where descents on the coarsest sample lead from the best places of each of ``choices``.

    They follow the surface closely: with a say as small as that of the inference a bad start would pass
    its own residuals off as noise.
    """
    placing, coarse = draw_sample(target, PLACING_POINTS, 0), draw_sample(target, STAGES[0], 0)
    found: list[Explanation] = []
    for fixed, piece in progress.over(choices):
        problem = Problem(model, prior, fixed, FOLLOWED_POINTS)
        for start in starts(problem, placing):
            found.append((problem, _descend([problem], [coarse], start, piece.quiet)))
    return found


def _weighed(problem: Problem) -> Problem:
    """The same unknowns, the surface counting for as much as one can bet on."""
    return dataclasses.replace(problem, independent=INDEPENDENT_POINTS)


def _different(found: Sequence[Explanation]) -> list[Explanation]:
    """The explanations worth pursuing, the best first, and of those that are alike only the best."""
    noise = min(descent.rows.noise for _, descent in found)
    ends = [linearise(_weighed(problem), end.rows, end.parameters, noise) for problem, end in found]
    least = [end.objective - end.gradient @ np.linalg.solve(end.hessian, end.gradient) for end in ends]
    kept: list[int] = []
    for number in map(int, np.argsort(least)):
        alike = (_alike(found[number], found[other], ends[other]) for other in kept)
        if not kept or (least[number] < least[kept[0]] + HOPELESS and not any(alike)):
            kept.append(number)
    return [found[number] for number in kept]


def _alike(one: Explanation, other: Explanation, end: Quadratic) -> bool:
    count = len(one[0].free)
    if not np.array_equal(one[0].fixed, other[0].fixed, equal_nan=True):
        return False
    offset = one[1].parameters[:count] - other[1].parameters[:count]
    return bool(offset @ np.linalg.solve(np.linalg.inv(end.hessian)[:count, :count], offset) < APART)


def _descend(
    problems: Sequence[Problem],
    samples: Sequence[Sample],
    parameters: Vector,
    progress: Progress,
) -> Descent:
    """From sample to sample, each with its problem; what is told as evaluations counts all of them."""
    spent = 0
    for (problem, sample), _ in progress.over(list(zip(problems, samples, strict=True))):
        descent = descend(problem, sample, parameters, MOST_STEPS, progress)
        if descent.stalled:
            descent = rescued(problem, sample, descent, MOST_STEPS, progress)
        parameters, spent = descent.parameters, spent + descent.evaluations
    return dataclasses.replace(descent, evaluations=spent)


def _followed(
    model: ShapeModel,
    prior: Prior,
    fit: ShapeFit,
    sample: Sample,
    progress: Progress,
) -> ShapeFit:
    """The code moved closer to the surface, the covariates staying where they were inferred."""
    problem = Problem(model, prior, fit.covariates, FOLLOWED_POINTS)
    start = problem.pack(fit.covariates, fit.latent)
    descent = _descend([problem], [sample], start, progress)
    latent = problem.unpack(descent.parameters)[1]
    return dataclasses.replace(fit, latent=latent, noise=descent.rows.noise, evaluations=descent.evaluations)
