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
from naisr_model.errors import Cancelled
from naisr_model.learning.least_squares import Descent, Problem, Sample, descend, evaluate, linearise
from naisr_model.learning.objective import Batch, latent_term, reconstruction_terms
from naisr_model.learning.prior import Prior, believed
from naisr_model.learning.target import Target
from naisr_model.networks.naisr import Naisr

Vector = NDArray[np.float64]
Progress = Callable[[float], None]
StopCheck = Callable[[], bool]

STAGES, MOST_STEPS = (256, 512, 768), 4
"""Surface points of each stage, freshly drawn and from coarse to fine, and its most steps."""

STARTS = 5
"""Places along the population at which unknown covariates are tried."""

SPACE_SHARE = 0.25
"""Points off the surface for each one on it, where the target says what is inside: they keep the shape from
turning inside out and surfaces away that the patient does not have."""

INDEPENDENT_POINTS = 5.0
"""M for what is inferred with its uncertainty, see :mod:`~naisr_model.learning.least_squares`. Found by
calibration: ``naisr evaluate calibration`` prints how often the intervals hold the truth."""

FOLLOWED_POINTS = 500.0
"""M for the code once the covariates are settled: the fitted surface should follow the patient's more
closely than one would bet on the code."""

RESCUE_STEPS, RESCUE_RATE = 60, 0.05
"""Adam steps, in standard deviations of the prior, where least squares stall."""

Draw = Callable[[np.random.Generator], Batch]
"""Fresh samples of all shapes that are fitted together."""


def fit_latents(
    network: Naisr,
    draw: Draw,
    covariates: Tensor,
    config: FitConfig,
    weights: LossWeights,
    *,
    progress: Callable[[float], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> Tensor:
    """The codes z that minimise the training loss at known covariates, by Adam from z = 0.

    Shapes are independent of each other; fitting many at once only shares the matrix products.

    Args:
        network: trained networks; they are not changed.
        draw: gives the samples of one step.
        covariates: centred, ``[shapes, N]``.
        config: steps, rate and seed.
        weights: of the loss terms.
        progress: told the finished share after every step.
        should_stop: polled before every step.

    Returns:
        ``[shapes, L]``.

    Raises:
        Cancelled: when ``should_stop()`` turned true.
    """
    latents = covariates.new_zeros(len(covariates), network.config.latent).requires_grad_()
    optimiser = torch.optim.Adam([latents], lr=config.rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, config.steps)
    frozen = [parameter for parameter in network.parameters() if parameter.requires_grad]
    for parameter in frozen:
        parameter.requires_grad_(False)
    try:
        for step in range(config.steps):
            if should_stop is not None and should_stop():
                raise Cancelled
            batch = draw(np.random.default_rng([config.seed, step]))
            optimiser.zero_grad()
            # Means over the shapes; multiplying by their number makes each fit its own problem.
            terms = reconstruction_terms(network, batch, covariates, latents, weights)
            terms |= latent_term(latents, weights)
            (len(latents) * torch.stack(list(terms.values())).sum()).backward()
            optimiser.step()
            schedule.step()
            if progress is not None:
                progress((step + 1) / config.steps)
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
        surprise: twice the negative log evidence, comparable between the fits of one shape.
        noise: robust standard deviation of the distances at surface points, model units.
        evaluations: points at which the networks were evaluated.
    """

    covariates: Vector
    latent: Vector
    free: NDArray[np.intp]
    spread: Vector
    surprise: float
    noise: float
    evaluations: int


def fit_shape(
    network: Naisr,
    target: Target,
    prior: Prior,
    known: Vector,
    binary: Sequence[int] = (),
    *,
    progress: Progress | None = None,
    should_stop: StopCheck | None = None,
) -> list[ShapeFit]:
    """The most probable code and unknown covariates of a shape, the maximum of p(c, z | points).

    Unknown covariates stay inside their observed range. A binary covariate has two levels and
    nothing between them, so each is fitted.

    Args:
        network: trained networks, not changed.
        target: samples of the shape.
        prior: of the training population.
        known: centred covariates, NaN where unknown, ``[N]``.
        binary: columns that only ever are -1 or +1.
        progress: told the finished share.
        should_stop: polled before every step.

    Returns:
        A fit for each combination of the unknown binary covariates' levels, the best first.

    Raises:
        Cancelled: when ``should_stop()`` turned true.
    """
    samples = [draw_sample(target, points, stage) for stage, points in enumerate(STAGES)]
    if not np.isnan(known).any():
        problem = Problem(network, prior, known, FOLLOWED_POINTS)
        descent = _descend(problem, samples, np.zeros(len(prior.code_root)), should_stop, progress)
        return [_result(problem, descent, descent.rows.noise)]
    settled: list[tuple[Problem, Descent]] = []
    combinations = _combinations(known, binary)
    for number, fixed in enumerate(combinations):
        problem = Problem(network, prior, fixed, INDEPENDENT_POINTS)
        told = _part(progress, number, len(combinations) + 1)
        start = _start(problem, samples[0])
        settled.append((problem, _descend(problem, samples, start, should_stop, told)))
    noise = min(descent.rows.noise for _, descent in settled)
    fits = sorted((_result(*one, noise) for one in settled), key=lambda fit: fit.surprise)
    told = _part(progress, len(combinations), len(combinations) + 1)
    return [_followed(network, prior, fits[0], samples[-1], should_stop, told), *fits[1:]]


def _descend(
    problem: Problem,
    samples: Sequence[Sample],
    parameters: Vector,
    should_stop: StopCheck | None,
    progress: Progress | None,
) -> Descent:
    """From sample to sample; what is told as evaluations counts all of them."""
    spent = 0
    for done, sample in enumerate(samples, start=1):
        descent = descend(problem, sample, parameters, MOST_STEPS, should_stop)
        if descent.stalled:
            descent = _rescued(problem, sample, descent, should_stop)
        parameters, spent = descent.parameters, spent + descent.evaluations
        if progress is not None:
            progress(done / len(samples))
    return dataclasses.replace(descent, evaluations=spent)


def _result(problem: Problem, descent: Descent, noise: float) -> ShapeFit:
    """With the evidence by Laplace's approximation, log p(points) = -(E + log det A) / 2 + constant.

    The prior of the free covariates is changed from a Gaussian to the population itself; the code
    follows the covariates along the valley of the objective.
    """
    end = linearise(problem, descent.rows, descent.parameters, noise)
    surprise = end.objective + float(np.linalg.slogdet(end.hessian)[1])
    count, parameters = len(problem.free), descent.parameters.copy()
    spread = np.zeros((count, count))
    if count:
        precision = np.linalg.inv(np.linalg.inv(end.hessian)[:count, :count])
        mean, spread = believed(problem.prior, problem.fixed, parameters[:count], precision)
        along = np.linalg.solve(end.hessian[count:, count:], end.hessian[count:, :count])
        parameters[count:] -= along @ (mean - parameters[:count])
        parameters[:count] = mean
    covariates, latent = problem.unpack(parameters)
    evaluations = descent.evaluations
    return ShapeFit(covariates, latent, problem.free, spread, surprise, descent.rows.noise, evaluations)


def _followed(
    network: Naisr,
    prior: Prior,
    fit: ShapeFit,
    sample: Sample,
    should_stop: StopCheck | None,
    progress: Progress | None,
) -> ShapeFit:
    """The code moved closer to the surface, the covariates staying where they were inferred."""
    problem = Problem(network, prior, fit.covariates, FOLLOWED_POINTS)
    start = problem.pack(fit.covariates, fit.latent)
    descent = _descend(problem, [sample], start, should_stop, progress)
    latent = problem.unpack(descent.parameters)[1]
    spent = fit.evaluations + descent.evaluations
    return dataclasses.replace(fit, latent=latent, noise=descent.rows.noise, evaluations=spent)


def _part(progress: Progress | None, number: int, parts: int) -> Progress | None:
    return None if progress is None else lambda share: progress((number + share) / parts)


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


def _start(problem: Problem, sample: Sample) -> Vector:
    """The most probable of some places along the population, the code being 0."""
    places = [np.concatenate([place, np.zeros(len(problem.prior.code_root))]) for place in _places(problem)]
    rows = [evaluate(problem, sample, place) for place in places]
    noise = min(one.noise for one in rows)
    scores = [linearise(problem, *pair, noise).objective for pair in zip(rows, places, strict=True)]
    return places[int(np.argmin(scores))]


def _places(problem: Problem) -> list[Vector]:
    """Free covariates of training rows, evenly along the direction in which these vary most."""
    free = problem.free
    if not len(free):
        return [np.zeros(0)]
    rows = problem.prior.training[:, free]
    main = np.linalg.eigh(np.atleast_2d(np.cov(rows, rowvar=False)))[1][:, -1]
    order = np.argsort(rows @ main)
    return list(rows[order[np.linspace(0, len(rows) - 1, STARTS + 2).round().astype(int)[1:-1]]])


def _rescued(problem: Problem, sample: Sample, descent: Descent, should_stop: StopCheck | None) -> Descent:
    """Adam where no damped step would go down, then least squares again; the better of the two ends."""
    parameters, noise = descent.parameters, descent.rows.noise
    first, second = np.zeros_like(parameters), np.zeros_like(parameters)
    for step in range(1, RESCUE_STEPS + 1):
        if should_stop is not None and should_stop():
            raise Cancelled
        rows = evaluate(problem, sample, parameters)
        gradient = linearise(problem, rows, parameters, noise).gradient
        first, second = 0.9 * first + 0.1 * gradient, 0.99 * second + 0.01 * gradient**2
        ratio = first / (1 - 0.9**step) / (np.sqrt(second / (1 - 0.99**step)) + 1e-12)
        parameters = problem.bounded(parameters - RESCUE_RATE * (1 - step / (RESCUE_STEPS + 1)) * ratio)
    again = descend(problem, sample, parameters, MOST_STEPS, should_stop)
    before, after = (
        linearise(problem, end.rows, end.parameters, noise).objective for end in (descent, again)
    )
    spent = descent.evaluations + again.evaluations + RESCUE_STEPS * len(sample.points)
    return dataclasses.replace(again if after < before else descent, evaluations=spent)
