"""What is known of the covariates of a shape, once the population and the shape have had their say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from naisr_model.learning.fitting.prior import Prior, conditional

NEIGHBOURS = 20
"""Training rows that shape the kernel of each row."""

NARROWEST = 0.03
"""Least standard deviation of a kernel, in those of the covariates."""

GRID = 512
"""Values of a covariate, evenly over its observed range, at which densities are tabulated."""


@dataclass(frozen=True, eq=False)
class Belief:
    """What is known of the free covariates of one shape.

    Attributes:
        mean: inside the observed ranges, ``[F]``.
        covariance: ``[F, F]``.
        densities: of each by itself, over the observed range, with sum 1, ``[F, GRID]``.
        log_gain: logarithm of the evidence with the population as the prior over that with its Gaussian.
    """

    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]
    densities: NDArray[np.float64]
    log_gain: float


def places_of(prior: Prior, column: int) -> NDArray[np.float64]:
    """The centred values that densities of a covariate are tabulated at, ``[GRID]``."""
    return np.linspace(prior.lowest[column], prior.highest[column], GRID)


class Told(NamedTuple):
    """What a shape says of its free covariates near one place: a Gaussian, the Gaussian prior included.

    ``log_height`` is the logarithm of its maximum, comparable between the places of one shape.
    """

    place: NDArray[np.float64]
    mean: NDArray[np.float64]
    precision: NDArray[np.float64]
    log_height: float


class Kernel(NamedTuple):
    """A weighted Gaussian over the free covariates."""

    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]
    log_weight: float


def believed(prior: Prior, fixed: NDArray[np.float64], told: Sequence[Told]) -> Belief:
    """What is known of the free covariates when the Gaussian prior gives way to the population itself.

    Covariates go together in ways that one Gaussian does not tell: infants weigh alike, adolescents do
    not. The Gaussian of :func:`conditional` is divided out of the posterior and a kernel density of
    the training rows, each kernel as wide as the row's neighbourhood, multiplied in; the result is a
    mixture of Gaussians, cut off where the observed ranges end. Nor does one Gaussian tell what a shape
    says of covariates far from the best ones, so each row takes what is told at the place nearest to it.

    Args:
        prior: with the training rows.
        fixed: centred covariates, NaN for the free ones, ``[N]``.
        told: what the shape says, the place of the fit first.
    """
    free, prior_mean, prior_precision = np.flatnonzero(np.isnan(fixed)), *conditional(prior, fixed)
    kernels = [_kernel_given(prior, fixed, row) for row in prior.training]
    places = np.array([one.place for one in told])
    parts = []
    for kernel in kernels:
        offsets = places - kernel.mean
        distances = np.einsum("pi,ij,pj->p", offsets, told[0].precision, offsets)
        parts.append(_weighted(told[int(distances.argmin())], prior_mean, prior_precision, kernel))
    means, covariances, logs = (np.array(column) for column in zip(*parts, strict=True))
    log_sum = float(np.logaddexp.reduce(logs))
    weights = np.exp(logs - log_sum)
    prior_covariance = np.asarray(np.linalg.inv(prior_precision), dtype=np.float64)
    own = Kernel(prior_mean, prior_covariance, 0.0)
    gaussian = _weighted(told[0], prior_mean, prior_precision, own).log_weight
    densities = _marginals(prior, free, weights, means, covariances)
    middle = np.array([d @ places_of(prior, int(i)) for d, i in zip(densities, free, strict=True)])
    offsets = means - weights @ means
    spread = np.einsum("k,kij->ij", weights, covariances) + (offsets.T * weights) @ offsets
    return Belief(middle, spread, densities, log_sum - gaussian)


def _weighted(
    told: Told,
    prior_mean: NDArray[np.float64],
    prior_precision: NDArray[np.float64],
    kernel: Kernel,
) -> Kernel:
    """What is told, without the Gaussian prior, times a kernel; its log weight is the log integral."""
    precision = told.precision - prior_precision
    pull = told.precision @ told.mean - prior_precision @ prior_mean
    at_zero = prior_mean @ prior_precision @ prior_mean - told.mean @ told.precision @ told.mean
    raised = kernel._replace(log_weight=kernel.log_weight + told.log_height + 0.5 * float(at_zero))
    return _product(precision, pull, raised)


def _product(precision: NDArray[np.float64], pull: NDArray[np.float64], kernel: Kernel) -> Kernel:
    """exp(-x precision x / 2 + pull x) times a kernel; its log weight is the log integral."""
    inverse = np.linalg.inv(kernel.covariance)
    covariance = np.linalg.inv(precision + inverse)
    peak = covariance @ (pull + inverse @ kernel.mean)
    exponent = peak @ (precision + inverse) @ peak - kernel.mean @ inverse @ kernel.mean
    determinants = np.linalg.slogdet(covariance)[1] - np.linalg.slogdet(kernel.covariance)[1]
    return Kernel(peak, covariance, kernel.log_weight + 0.5 * float(exponent + determinants))


def _marginals(
    prior: Prior,
    free: NDArray[np.intp],
    weights: NDArray[np.float64],
    means: NDArray[np.float64],
    covariances: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Densities of each covariate of a mixture of Gaussians on its grid, ``[F, GRID]``."""
    result = np.zeros((len(free), GRID))
    for number, column in enumerate(free):
        deviations = np.sqrt(covariances[:, number, number])
        scores = (places_of(prior, column) - means[:, number, None]) / deviations[:, None]
        result[number] = (weights / deviations) @ np.exp(-0.5 * scores**2) + 1e-300
    return result / result.sum(axis=1, keepdims=True)


def _kernel_given(prior: Prior, fixed: NDArray[np.float64], row: NDArray[np.float64]) -> Kernel:
    """One row's kernel given the known covariates."""
    free, known = np.isnan(fixed), ~np.isnan(fixed)
    distance = np.linalg.norm(prior.training - row, axis=1)
    offsets = prior.training[np.argsort(distance)[:NEIGHBOURS]] - row
    kernel = offsets.T @ offsets / len(offsets) + NARROWEST**2 * np.eye(len(row))
    inverse = np.linalg.inv(kernel[np.ix_(known, known)])
    gap, gain = (fixed - row)[known], kernel[np.ix_(free, known)] @ inverse
    log_weight = -0.5 * gap @ inverse @ gap - 0.5 * np.linalg.slogdet(kernel[np.ix_(known, known)])[1]
    covariance = kernel[np.ix_(free, free)] - gain @ kernel[np.ix_(known, free)]
    return Kernel(row[free] + gain @ gap, covariance, float(log_weight))
