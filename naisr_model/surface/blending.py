"""What is known at some points of a surface, carried to the others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

NEIGHBOURS = 4
"""Known points that are blended for each of the others."""

TOUCHING = 1e-6
"""Added to every distance, so that a known point keeps its own value."""


def blended(known: NDArray, values: NDArray[np.float64], points: NDArray) -> NDArray[np.float64]:
    """Values at ``points``, from those of the nearest known points by their inverse distances.

    Args:
        known: where the values are known, ``[k, dim]``, at least one.
        values: ``[k]``, or several of each, ``[k, ...]``.
        points: ``[n, dim]``, in the unit of ``known``.

    Returns:
        ``[n]``, or ``[n, ...]``.
    """
    away, nearest = cKDTree(known).query(points, k=min(NEIGHBOURS, len(known)))
    weights = 1 / (away.reshape(len(points), -1) + TOUCHING)
    shares = weights / weights.sum(axis=1, keepdims=True)
    return np.asarray(np.einsum("nk,nk...->n...", shares, values[nearest.reshape(weights.shape)]))
