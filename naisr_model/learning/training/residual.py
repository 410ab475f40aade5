"""Latent codes as residuals: what the covariates explain is taken out of the codes.

Reconstruction alone lets z do the covariates' work: an effect then looks smaller than it is, and
Phi(c, z = 0) is no longer the population's shape at c. Projecting the codes of the training shapes
on the orthogonal complement of smooth functions of c makes every such function uncorrelated with
every entry of z, exactly and at every iteration, as residuals are in linear regression.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

SHAPES_A_FUNCTION = 5
"""A function is added to the basis only while there are this many shapes for each."""

KNOTS = 12
"""Tent functions of each continuous covariate, at even quantiles. Low powers are not enough: what is
steeper than they are, such as the growth of infants, then goes into the codes."""


def covariate_basis(covariates: NDArray[np.float64], binary: tuple[int, ...]) -> NDArray[np.float64]:
    """Orthonormal basis of 1, c_i, tents in every continuous c_i, and products c_i c_j.

    Args:
        covariates: centred, of the training shapes, ``[n, N]``.
        binary: columns that only ever are -1 or +1; tents would say nothing new of them.

    Returns:
        ``[n, K]`` with orthonormal columns, K at most ``n / SHAPES_A_FUNCTION`` (at least 1).
    """
    count, columns = covariates.shape
    continuous = [i for i in range(columns) if i not in binary]
    pairs = itertools.combinations(range(columns), 2)
    functions = [np.ones(count), *covariates.T]
    functions += [tent for i in continuous for tent in _tents(covariates[:, i])]
    functions += [covariates[:, i] * covariates[:, j] for i, j in pairs]
    kept = np.stack(functions[: max(1, count // SHAPES_A_FUNCTION)], axis=1)
    left, singular, _ = np.linalg.svd(kept / np.linalg.norm(kept, axis=0).clip(1e-12), full_matrices=False)
    return left[:, singular > 1e-6 * singular[0]]


def _tents(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Piecewise linear functions that are 1 at one of :data:`KNOTS` quantiles and 0 at the others."""
    knots = np.unique(np.quantile(values, np.linspace(0, 1, KNOTS)))
    return np.array([np.interp(values, knots, unit) for unit in np.eye(len(knots))])


def residual_latents(codes: Tensor, basis: Tensor) -> Tensor:
    """The codes ``[n, L]`` less their projection on orthonormal columns ``basis [n, K]``."""
    return codes - basis @ (basis.T @ codes)
