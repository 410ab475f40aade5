"""What a descent has found of a shape: how probable it is, and what it says of the covariates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from naisr_model.learning.fitting.belief import Told, believed
from naisr_model.learning.fitting.least_squares import Descent, Problem, evaluate, linearise
from naisr_model.learning.fitting.target import Sample

Vector = NDArray[np.float64]

SHARES = (-2.0, -1.0, 1.0, 2.0)
"""Standard deviations from the fit, along each axis, at which the shape is asked again what it tells."""


@dataclass(frozen=True, eq=False)
class ShapeFit:
    """The most probable parameters of one shape, for some levels of the binary covariates.

    Attributes:
        covariates: centred, the known ones included, ``[N]``.
        latent: the code z, ``[L]``.
        free: columns of the covariates that were inferred from continuous values.
        spread: covariance of those, ``[F, F]``.
        densities: of each over its observed range, see :class:`~naisr_model.learning.fitting.belief.Belief`.
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


def shape_fit(problem: Problem, descent: Descent, noise: float, sample: Sample) -> ShapeFit:
    """What a descent found, with the evidence by Laplace's approximation.

    That is log p(points) = -(E + log det A) / 2 + constant. The prior of the free covariates is changed from
    a Gaussian to the population itself, and what the shape says of them is asked at some places about the
    fit on ``sample``; the code follows the covariates along the valley of the objective.
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
