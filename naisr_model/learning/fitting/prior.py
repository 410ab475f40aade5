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
were fitted. Calibrated together with ``least_squares.INDEPENDENT_POINTS``."""

UNSEEN_LASTING = 0.9
"""Taken for the correlation of two visits' codes where nobody was seen twice; a choice."""


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
        lasting: correlation of the codes of two visits of one person, 0 to 1.
    """

    code_root: NDArray[np.float64]
    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]
    lowest: NDArray[np.float64]
    highest: NDArray[np.float64]
    training: NDArray[np.float64]
    lasting: float


def prior_of(population: Population, latents: NDArray[np.float32]) -> Prior:
    """The prior of a population and its training codes ``[n_train, L]``."""
    rows = population.normalised()[~population.held_out]
    bounds = np.array([c.normalise(c.range) for c in population.covariates]).reshape(-1, 2)
    subjects = np.array(population.subjects)[~population.held_out]
    return Prior(
        code_root=_root(latents.astype(np.float64)),
        mean=rows.mean(axis=0),
        covariance=np.atleast_2d(np.cov(rows, rowvar=False)) + 1e-6 * np.eye(rows.shape[1]),
        lowest=bounds[:, 0],
        highest=bounds[:, 1],
        training=rows,
        lasting=_lasting(latents.astype(np.float64), subjects),
    )


def _lasting(codes: NDArray[np.float64], subjects: NDArray[np.str_]) -> float:
    """Intraclass correlation of codes ``[n, L]``, whose average is 0, over all their directions.

    It is 1 less the variance within a subject as a share of the whole.
    """
    _, own, visits = np.unique(subjects, return_inverse=True, return_counts=True)
    if visits.max() == 1:
        return UNSEEN_LASTING
    means = np.stack([codes[own == number].mean(axis=0) for number in range(len(visits))])
    within = np.sum((codes - means[own]) ** 2) / np.sum(visits - 1)
    whole = np.mean(np.sum(codes**2, axis=1))
    return float(np.clip(1 - within / whole, 0, 1)) if whole else 0.0


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
