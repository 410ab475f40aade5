"""Keeping whole subjects aside for evaluation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def held_out_mask(subjects: Sequence[str], share: float = 0.2, seed: int = 0) -> NDArray[np.bool_]:
    """Choose the subjects whose visits are never trained on.

    Args:
        subjects: subject identifier of each row; the order of the rows does not matter.
        share: part of the **subjects** (not of the rows) to hold out, 0 to below 1.
        seed: other seeds choose other subjects.

    Returns:
        bool ``[n]``, true for held-out rows. At least one subject stays in training.
    """
    unique = np.unique(np.asarray(subjects, dtype=str))
    count = min(round(share * len(unique)), len(unique) - 1)
    chosen = np.random.default_rng(seed).permutation(unique)[:count]
    return np.isin(np.asarray(subjects, dtype=str), chosen)
