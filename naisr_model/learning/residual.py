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

SHAPES_A_FUNCTION = 5
"""A function is added to the basis only while there are this many shapes for each."""


def smooth_basis(covariates: NDArray[np.float64], binary: tuple[int, ...]) -> NDArray[np.float64]:
    """Orthonormal basis of 1, c_i, c_i c_j, c_i^2, c_i^3 and c_i^4 over the training shapes.

    Args:
        covariates: centred, ``[n, N]``.
        binary: columns whose powers say nothing new.

    Returns:
        ``[n, K]`` with orthonormal columns, K at most ``n / SHAPES_A_FUNCTION`` (at least 1).
    """
    count, columns = covariates.shape
    continuous = [i for i in range(columns) if i not in binary]
    functions = [np.ones(count), *covariates.T]
    functions += [covariates[:, i] ** 2 for i in continuous]
    functions += [covariates[:, i] * covariates[:, j] for i, j in itertools.combinations(range(columns), 2)]
    functions += [covariates[:, i] ** power for power in (3, 4) for i in continuous]
    kept = np.stack(functions[: max(1, count // SHAPES_A_FUNCTION)], axis=1)
    left, singular, _ = np.linalg.svd(kept / np.linalg.norm(kept, axis=0).clip(1e-12), full_matrices=False)
    return left[:, singular > 1e-6 * singular[0]]
