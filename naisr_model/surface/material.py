"""Material points: where a point of the template is in a shape, and what each covariate has to do with it.

A shape's point p belongs to the template's q = p + d(p), d = sum_i g_i; so q is found in the shape at the p
that solves

    p + d(p, c, z) = q,

and has come from there by p - q = sum_i -g_i(p, c_i, z). The sum is exact, whatever the shape: the parts are
taken at one and the same p.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from naisr_model.errors import InputError
from naisr_model.models.base import AdditiveModel, DeformableModel
from naisr_model.models.derivatives import gradient, jacobian

RESOLVED = 1e-5
"""Model units within which p + d(p) must meet q; single precision gives a fifth of it."""

LONGEST_STEP = 0.1
"""Of Newton's method, in model units."""

STEPS = 30


class Parts(NamedTuple):
    """What moved material points, model units.

    Attributes:
        points: p, ``[n, dim]``.
        normals: grad Phi there, made unit vectors, ``[n, dim]``.
        effects: -g_i(p, c_i, 0), ``[N, n, dim]``: what the covariates do to everybody.
        person: what the code adds to their sum, ``[n, dim]``.
    """

    points: Tensor
    normals: Tensor
    effects: Tensor
    person: Tensor


def origins(model: DeformableModel, points: Tensor, covariates: Tensor, latent: Tensor) -> Tensor:
    """The points q = p + d(p) of the template that ``points [n, dim]`` of a shape belong to."""
    with torch.no_grad():
        return points + model.displacement(points[None], covariates[None], latent[None])[0]


def places(
    model: DeformableModel,
    targets: Tensor,
    covariates: Tensor,
    latent: Tensor,
    start: Tensor | None = None,
) -> Tensor:
    """Newton's method for p + d(p) = q, ``[n, dim]``.

    Args:
        model: whose d it is.
        targets: q, ``[n, dim]`` in model units.
        covariates: c, centred, ``[N]``.
        latent: z, ``[L]``.
        start: guesses of p; q itself when left out.

    Raises:
        InputError: where no p is found, because the deformation folds there.
    """
    points = targets if start is None else start
    identity = torch.eye(targets.shape[-1], dtype=targets.dtype, device=targets.device)
    for _ in range(STEPS):
        located = points.detach()[None].requires_grad_()
        displaced = model.displacement(located, covariates[None], latent[None])
        missing = (targets - points - displaced[0]).detach()
        if missing.norm(dim=-1).max() <= RESOLVED:
            return points
        slopes = identity + jacobian(displaced, located)[0].detach()
        points = points + shortened(torch.linalg.lstsq(slopes, missing[..., None]).solution[..., 0])
    raise InputError(
        "the deformation folds at this point, so it has no one place in the shape; choose another"
    )


def parts(model: AdditiveModel, points: Tensor, covariates: Tensor, latent: Tensor) -> Parts:
    """What moved the material points that are at ``points [n, dim]`` in the shape of ``covariates [N]``."""
    located = points.detach()[None].requires_grad_()
    moved = model.displacements(located, covariates[None], latent[None])[:, 0]
    normals = gradient(model.template(located + moved.sum(dim=0)), located)[0].detach()
    with torch.no_grad():
        alone = model.displacements(located, covariates[None], torch.zeros_like(latent)[None])[:, 0]
        unit = normals / normals.norm(dim=-1, keepdim=True).clamp(min=1e-12)
        return Parts(points, unit, -alone, (alone - moved).sum(dim=0).detach())


def shortened(steps: Tensor) -> Tensor:
    """Steps ``[..., dim]``, none longer than :data:`LONGEST_STEP`."""
    return steps * (LONGEST_STEP / steps.norm(dim=-1, keepdim=True).clamp(min=LONGEST_STEP))
