"""What is known of a shape before it is seen: codes and covariates as in the training population."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from naisr_model.covariates import Population

SHRINKAGE = 0.1
"""Share of the codes' mean variance that is added in every direction: a population of some hundred shapes
leaves directions of the code unused that another shape may need."""

WIDENING = 2.0
"""Standard deviation of an unseen shape's code over that of the training codes, to which the networks
were fitted. Calibrated together with ``fit.INDEPENDENT_POINTS``."""


@dataclass(frozen=True, eq=False)
class Prior:
    """Independent Gaussians of the code and of the centred covariates.

    Attributes:
        code_root: ``B`` with z = B w, w standard normal, ``[L, L]``.
        mean: of the covariates, ``[N]``.
        covariance: of the covariates, ``[N, N]``.
        lowest: smallest observed centred covariates, ``[N]``.
        highest: largest ones, ``[N]``.
        training: centred covariates of the training rows, ``[n_train, N]``.
    """

    code_root: NDArray[np.float64]
    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]
    lowest: NDArray[np.float64]
    highest: NDArray[np.float64]
    training: NDArray[np.float64]


def prior_of(population: Population, latents: NDArray[np.float32]) -> Prior:
    """The prior of a population and its training codes ``[n_train, L]``."""
    rows = population.normalised()[~population.held_out]
    bounds = np.array([c.normalise(c.range) for c in population.covariates])
    return Prior(
        code_root=_root(latents.astype(np.float64)),
        mean=rows.mean(axis=0),
        covariance=np.atleast_2d(np.cov(rows, rowvar=False)) + 1e-6 * np.eye(rows.shape[1]),
        lowest=bounds[:, 0],
        highest=bounds[:, 1],
        training=rows,
    )


def _root(latents: NDArray[np.float64]) -> NDArray[np.float64]:
    """A square root of the shrunk and widened second moments of the codes about 0, their average."""
    moments = latents.T @ latents / len(latents)
    moments += max(SHRINKAGE * np.trace(moments) / len(moments), 1e-12) * np.eye(len(moments))
    return WIDENING * np.asarray(np.linalg.cholesky(moments))


def conditional(prior: Prior, fixed: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean ``[F]`` and precision ``[F, F]`` of the F covariates that are NaN in ``fixed [N]``."""
    free, known = np.isnan(fixed), ~np.isnan(fixed)
    joint = prior.covariance
    gain = joint[np.ix_(free, known)] @ np.linalg.inv(joint[np.ix_(known, known)])
    mean = prior.mean[free] + gain @ (fixed - prior.mean)[known]
    return mean, np.linalg.inv(joint[np.ix_(free, free)] - gain @ joint[np.ix_(known, free)])


NEIGHBOURS = 20
"""Training rows that shape the kernel of each row."""

NARROWEST = 0.03
"""Least standard deviation of a kernel, in those of the covariates."""


def believed(
    prior: Prior, fixed: NDArray[np.float64], mean: NDArray[np.float64], precision: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What is known of the free covariates when the Gaussian prior gives way to the population itself.

    Covariates go together in ways that one Gaussian does not tell: infants weigh alike, adolescents do
    not. The Gaussian of :func:`conditional` is divided out of the posterior and a kernel density of
    the training rows, each kernel as wide as the row's neighbourhood, multiplied in; the result, a
    mixture of Gaussians, is described by its mean and covariance.

    Args:
        prior: with the training rows.
        fixed: centred covariates, NaN for the free ones, ``[N]``.
        mean: of the posterior of the free covariates under the Gaussian prior, ``[F]``.
        precision: of that posterior, ``[F, F]``.

    Returns:
        Mean ``[F]``, inside the observed ranges, and covariance ``[F, F]``.
    """
    prior_mean, prior_precision = conditional(prior, fixed)
    told = precision - prior_precision
    pull = precision @ mean - prior_precision @ prior_mean
    means, covariances, logs = [], [], []
    for row in prior.training:
        centre, kernel, log_weight = _kernel_given(prior, fixed, row)
        inverse = np.linalg.inv(kernel)
        covariance = np.linalg.inv(told + inverse)
        peak = covariance @ (pull + inverse @ centre)
        # log of the integral of kernel times likelihood, up to what all rows share
        exponent = peak @ (told + inverse) @ peak - centre @ inverse @ centre
        determinants = np.linalg.slogdet(covariance)[1] - np.linalg.slogdet(kernel)[1]
        means.append(peak)
        covariances.append(covariance)
        logs.append(log_weight + 0.5 * (exponent + determinants))
    weights = np.exp(np.array(logs) - max(logs))
    weights /= weights.sum()
    centre = weights @ np.array(means)
    offsets = np.array(means) - centre
    spread = np.einsum("k,kij->ij", weights, np.array(covariances)) + (offsets.T * weights) @ offsets
    free = np.isnan(fixed)
    return np.clip(centre, prior.lowest[free], prior.highest[free]), spread


def _kernel_given(
    prior: Prior, fixed: NDArray[np.float64], row: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Mean and covariance of one row's kernel given the known covariates, and its log weight."""
    free, known = np.isnan(fixed), ~np.isnan(fixed)
    distance = np.linalg.norm(prior.training - row, axis=1)
    offsets = prior.training[np.argsort(distance)[:NEIGHBOURS]] - row
    kernel = offsets.T @ offsets / len(offsets) + NARROWEST**2 * np.eye(len(row))
    inverse = np.linalg.inv(kernel[np.ix_(known, known)])
    gap, gain = (fixed - row)[known], kernel[np.ix_(free, known)] @ inverse
    log_weight = -0.5 * gap @ inverse @ gap - 0.5 * np.linalg.slogdet(kernel[np.ix_(known, known)])[1]
    covariance = kernel[np.ix_(free, free)] - gain @ kernel[np.ix_(known, free)]
    return row[free] + gain @ gap, covariance, float(log_weight)
