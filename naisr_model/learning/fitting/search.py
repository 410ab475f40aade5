"""Fitting codes and covariates to given shapes with the networks fixed (section "Testing" of the paper).

:func:`fit_shape` is the fast way, least squares on first-order distances; :func:`fit_latents` is the
paper's procedure and the reference that the fast way is measured against.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from naisr_model.config import FitConfig, LossWeights
from naisr_model.learning.fitting.least_squares import (
    TOLERATED,
    Descent,
    Linearised,
    Problem,
    Sample,
    descend,
    evaluate,
    linearise,
)
from naisr_model.learning.fitting.prior import Prior, Told, believed
from naisr_model.learning.fitting.target import Target
from naisr_model.learning.training.objective import Batch, latent_term, reconstruction_terms
from naisr_model.models.base import ShapeModel
from naisr_model.progress import SILENT, Progress

Vector = NDArray[np.float64]

STAGES, MOST_STEPS = (256, 512, 768), 4
"""Surface points of each stage, freshly drawn and from coarse to fine, and its most steps."""

DRAWN_IN = (4 * TOLERATED, 2 * TOLERATED, TOLERATED)
"""k of each stage where all covariates are known: a limb that is off by its own width is first drawn in; at
once held for something that the atlas does not know, it would stay where it is."""

STARTS, PLACING_POINTS, PURSUED = 12, 128, 3
"""Places over the population at which unknown covariates are tried, on so many surface points, and how many
of the best are pursued: a big child and a small adult are both good explanations until one looks closer."""

HOPELESS = 25.0
"""Twice the log odds against an explanation at which it is pursued no further."""

APART = 4.0
"""Squared distance of the covariates, in standard deviations, from which on two explanations are two."""

SPACE_SHARE = 0.25
"""Points off the surface for each one on it, where the target says what is inside: they keep the shape from
turning inside out and surfaces away that the patient does not have."""

SHARES = (-2.0, -1.0, 1.0, 2.0)
"""Standard deviations from the fit, along each axis, at which the shape is asked again what it tells."""

INDEPENDENT_POINTS = 5.0
"""M for what is inferred with its uncertainty, see :mod:`~naisr_model.learning.fitting.least_squares`: so
few because what the atlas cannot express looks like a change of covariates over the whole shape. Chosen over
60 synthetic patients of each shipped atlas, of other seeds than those of the training and of ``naisr
evaluate calibration``, which counts how often the intervals hold the truth."""

FOLLOWED_POINTS = 500.0
"""M for the code once the covariates are settled: the fitted surface should follow the patient's more
closely than one would bet on the code."""

RESCUE_STEPS, RESCUE_RATE = 60, 0.05
"""Adam steps, in standard deviations of the prior, where least squares stall."""

Explanation = tuple[Problem, Descent]
"""What is given of the covariates, and where a descent on the rest ended."""

Draw = Callable[[np.random.Generator], Batch]
"""Fresh samples of all shapes that are fitted together."""


def fit_latents(
    model: ShapeModel,
    draw: Draw,
    covariates: Tensor,
    config: FitConfig,
    weights: LossWeights,
    *,
    progress: Progress = SILENT,
) -> Tensor:
    """The codes z that minimise the training loss at known covariates, by Adam from z = 0.

    Shapes are independent of each other; fitting many at once only shares the matrix products.

    Args:
        model: trained, not changed.
        draw: gives the samples of one step.
        covariates: centred, ``[shapes, N]``.
        config: steps, rate and seed.
        weights: of the loss terms.
        progress: told the finished share after every step, checked before each.

    Returns:
        ``[shapes, L]``.

    Raises:
        Cancelled: when nobody waits for it any more.
    """
    latents = covariates.new_zeros(len(covariates), model.config.latent).requires_grad_()
    optimiser = torch.optim.Adam([latents], lr=config.rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, config.steps)
    frozen = [parameter for parameter in model.parameters() if parameter.requires_grad]
    for parameter in frozen:
        parameter.requires_grad_(False)
    try:
        for step, _ in progress.over(range(config.steps)):
            batch = draw(np.random.default_rng([config.seed, step]))
            optimiser.zero_grad()
            # Means over the shapes; multiplying by their number makes each fit its own problem.
            terms = reconstruction_terms(model, batch, covariates, latents, weights)
            terms |= latent_term(latents, weights)
            (len(latents) * torch.stack(list(terms.values())).sum()).backward()
            optimiser.step()
            schedule.step()
    finally:
        for parameter in frozen:
            parameter.requires_grad_(True)
    return latents.detach()


@dataclass(frozen=True, eq=False)
class ShapeFit:
    """The most probable parameters of one shape, for some levels of the binary covariates.

    Attributes:
        covariates: centred, the known ones included, ``[N]``.
        latent: the code z, ``[L]``.
        free: columns of the covariates that were inferred from continuous values.
        spread: covariance of those, ``[F, F]``.
        densities: of each over its observed range, see :class:`~naisr_model.learning.fitting.prior.Belief`.
        surprise: twice the negative log evidence, comparable between the fits of one shape.
        noise: robust standard deviation of the distances at surface points, model units.
        evaluations: points at which the networks were evaluated.
    """

    covariates: Vector
    latent: Vector
    free: NDArray[np.intp]
    spread: Vector
    densities: Vector
    surprise: float
    noise: float
    evaluations: int


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
        return [_result(problem, descent, descent.rows.noise, samples[0])]
    begun = _begun(model, target, prior, _combinations(known, binary), progress.part(0, 1 / 3))
    settled: list[Explanation] = []
    pursued = _different(begun)
    for (followed, descent), piece in progress.part(1 / 3, 2 / 3).over(pursued):
        problem = _weighed(followed)
        settled.append((problem, _descend([problem] * 2, samples[1:], descent.parameters, piece)))
    noise = min(descent.rows.noise for _, descent in settled)
    fits = sorted(
        (_result(*one, noise, samples[0]) for one in _different(settled)), key=lambda fit: fit.surprise
    )
    best = _followed(model, prior, fits[0], samples[-1], progress.part(2 / 3, 1))
    asked = len(fits) * (1 + len(SHARES) * len(fits[0].free)) * len(samples[0].points)
    spent = sum(descent.evaluations for _, descent in begun + settled) + best.evaluations + asked
    return [dataclasses.replace(best, evaluations=spent), *fits[1:]]


def _begun(
    model: ShapeModel,
    target: Target,
    prior: Prior,
    combinations: Sequence[Vector],
    progress: Progress,
) -> list[Explanation]:
    """Where descents on the coarsest sample lead from the best places of each combination.

    They follow the surface closely: with a say as small as that of the inference a bad start would pass
    its own residuals off as noise.
    """
    placing, coarse = draw_sample(target, PLACING_POINTS, 0), draw_sample(target, STAGES[0], 0)
    found: list[Explanation] = []
    for fixed, piece in progress.over(combinations):
        problem = Problem(model, prior, fixed, FOLLOWED_POINTS)
        for start in _starts(problem, placing):
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


def _alike(one: Explanation, other: Explanation, end: Linearised) -> bool:
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
            descent = _rescued(problem, sample, descent, progress)
        parameters, spent = descent.parameters, spent + descent.evaluations
    return dataclasses.replace(descent, evaluations=spent)


def _result(problem: Problem, descent: Descent, noise: float, sample: Sample) -> ShapeFit:
    """With the evidence by Laplace's approximation, log p(points) = -(E + log det A) / 2 + constant.

    The prior of the free covariates is changed from a Gaussian to the population itself, and what the
    shape says of them is asked at some places about the fit on ``sample``; the code follows the covariates
    along the valley of the objective.
    """
    end = linearise(problem, descent.rows, descent.parameters, noise)
    surprise = end.objective + float(np.linalg.slogdet(end.hessian)[1])
    count, parameters = len(problem.free), descent.parameters.copy()
    spread, densities = np.zeros((count, count)), np.zeros((count, 0))
    if count:
        slopes = np.linalg.solve(end.hessian[count:, count:], end.hessian[count:, :count])
        along = np.asarray(slopes, dtype=np.float64)
        here = _told(problem, sample, parameters, noise)
        spread = believed(problem.prior, problem.fixed, [here]).covariance
        there = [
            _told(problem, sample, _shifted(problem, parameters, along, offset), noise)
            for offset in _offsets(spread)
        ]
        belief = believed(problem.prior, problem.fixed, [here, *there])
        spread, densities, surprise = belief.covariance, belief.densities, surprise - 2 * belief.log_gain
        parameters = _shifted(problem, parameters, along, belief.mean - parameters[:count])
    covariates, latent = problem.unpack(parameters)
    return ShapeFit(
        covariates=covariates,
        latent=latent,
        free=problem.free,
        spread=spread,
        densities=densities,
        surprise=surprise,
        noise=descent.rows.noise,
        evaluations=descent.evaluations,
    )


def _offsets(spread: Vector) -> list[Vector]:
    """Along each principal axis, to both sides."""
    values, axes = np.linalg.eigh(spread)
    steps = axes * np.sqrt(values)
    return [share * step for step in steps.T for share in SHARES]


def _shifted(problem: Problem, parameters: Vector, along: Vector, offset: Vector) -> Vector:
    """Other covariates, the code following them down the valley of the objective."""
    count, result = len(offset), parameters.copy()
    result[:count] += offset
    result = problem.bounded(result)
    result[count:] -= along @ (result[:count] - parameters[:count])
    return result


def _told(problem: Problem, sample: Sample, parameters: Vector, noise: float) -> Told:
    """What the shape says of the covariates near ``parameters``, whatever the code is."""
    count = len(problem.free)
    near = linearise(problem, evaluate(problem, sample, parameters), parameters, noise)
    covariance = np.linalg.inv(near.hessian)
    step = -covariance @ near.gradient
    log_height = -0.5 * (near.objective + float(near.gradient @ step))
    log_height -= 0.5 * float(np.linalg.slogdet(near.hessian[count:, count:])[1])
    place = parameters[:count]
    return Told(place, place + step[:count], np.linalg.inv(covariance[:count, :count]), log_height)


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


def draw_sample(target: Target, points: int, seed: int) -> Sample:
    """``points`` surface points, or all there are, and their share of points off the surface."""
    rng, dim = np.random.default_rng(seed), target.surface.shape[1]
    surface = target.surface[rng.permutation(len(target.surface))[:points]]
    space = target.space[rng.permutation(len(target.space))[: int(SPACE_SHARE * len(surface))]]
    return Sample(
        torch.as_tensor(np.concatenate([surface, space[:, :dim]])),
        torch.as_tensor(np.concatenate([np.zeros(len(surface), np.float32), space[:, dim]])),
    )


def _combinations(known: Vector, binary: Sequence[int]) -> list[Vector]:
    """``known`` with every choice of levels of the unknown binary covariates."""
    unknown = [column for column in binary if np.isnan(known[column])]
    result = []
    for levels in itertools.product((-1.0, 1.0), repeat=len(unknown)):
        fixed = known.copy()
        fixed[unknown] = levels
        result.append(fixed)
    return result


def _starts(problem: Problem, sample: Sample) -> list[Vector]:
    """The most probable of some places over the population, the code being 0; the best first."""
    places = [np.concatenate([place, np.zeros(len(problem.prior.code_root))]) for place in _places(problem)]
    rows = [evaluate(problem, sample, place) for place in places]
    noise = min(one.noise for one in rows)
    scores = [linearise(problem, *pair, noise).objective for pair in zip(rows, places, strict=True)]
    return [places[number] for number in np.argsort(scores)[:PURSUED]]


def _places(problem: Problem) -> list[Vector]:
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


def _rescued(problem: Problem, sample: Sample, descent: Descent, progress: Progress) -> Descent:
    """Adam where no damped step would go down, then least squares again; the better of the two ends."""
    parameters, noise = descent.parameters, descent.rows.noise
    first, second = np.zeros_like(parameters), np.zeros_like(parameters)
    for step in range(1, RESCUE_STEPS + 1):
        progress.check()
        rows = evaluate(problem, sample, parameters)
        gradient = linearise(problem, rows, parameters, noise).gradient
        first, second = 0.9 * first + 0.1 * gradient, 0.99 * second + 0.01 * gradient**2
        ratio = first / (1 - 0.9**step) / (np.sqrt(second / (1 - 0.99**step)) + 1e-12)
        parameters = problem.bounded(parameters - RESCUE_RATE * (1 - step / (RESCUE_STEPS + 1)) * ratio)
    again = descend(problem, sample, parameters, MOST_STEPS, progress)
    before, after = (
        linearise(problem, end.rows, end.parameters, noise).objective for end in (descent, again)
    )
    spent = descent.evaluations + again.evaluations + RESCUE_STEPS * len(sample.points)
    return dataclasses.replace(again if after < before else descent, evaluations=spent)
