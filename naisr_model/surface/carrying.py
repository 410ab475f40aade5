"""Points of the template carried to many shapes at once: p + d(p, c, z) = q by Broyden's method.

Each point has an approximate inverse of its own 3 x 3 Jacobian, which every step corrects by what the step
has shown, so that a step costs one evaluation of d where Newton's method needs its derivatives.
"""

from __future__ import annotations

import torch
from torch import Tensor

from naisr_model.errors import InputError
from naisr_model.models.base import DeformableModel
from naisr_model.surface.material import shortened
from naisr_model.surface.tracking import RESOLVED

STEPS = 25

LEAST_PIVOT = 1e-12
"""Of a correction; below it a step has shown nothing."""

MISSED_SHARE = 0.01
"""Of the points, at most, for which no place was found; they stay where p + d(p) came near q."""


def carried(model: DeformableModel, targets: Tensor, covariates: Tensor, latents: Tensor) -> Tensor:
    """Where the template's points q are in several shapes, ``[shapes, n, dim]``, model units.

    Args:
        model: whose d it is.
        targets: q, ``[n, dim]`` in model units.
        covariates: c, centred, ``[shapes, N]``.
        latents: z, ``[shapes, L]``.

    Raises:
        InputError: where too many points have no place, because the deformation folds there.
    """
    points = targets.expand(len(covariates), -1, -1)
    inverses = torch.eye(targets.shape[-1]).to(targets).expand(*points.shape, -1)
    with torch.no_grad():
        missing = targets - points - model.displacement(points, covariates, latents)
        for _ in range(STEPS):
            if missing.norm(dim=-1).max() <= RESOLVED:
                return points
            steps = shortened(_times(inverses, missing))
            points = points + steps
            before, missing = missing, targets - points - model.displacement(points, covariates, latents)
            inverses = _corrected(inverses, steps, before - missing)
    if (missing.norm(dim=-1) > RESOLVED).double().mean() > MISSED_SHARE:
        raise InputError("the deformation folds, so that points of the template have no place; choose others")
    return points


def _corrected(inverses: Tensor, steps: Tensor, shown: Tensor) -> Tensor:
    """The nearest inverses that take what a step has shown of p + d(p) back to the step."""
    reached, rows = _times(inverses, shown), _times(inverses.mT, steps)
    pivots = (rows * shown).sum(dim=-1, keepdim=True)
    pivots = torch.where(pivots.abs() < LEAST_PIVOT, torch.inf, pivots)
    return inverses + ((steps - reached) / pivots)[..., None] * rows[..., None, :]


def _times(matrices: Tensor, vectors: Tensor) -> Tensor:
    return (matrices @ vectors[..., None])[..., 0]
