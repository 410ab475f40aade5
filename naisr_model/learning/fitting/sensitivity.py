"""How the distance of a point to the shape changes with the shape's covariates and code.

Every point gets a copy of c and z of its own, so one backward pass gives the whole Jacobian: a
Gauss-Newton step costs no more than a step of gradient descent.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from naisr_model.models.base import ShapeModel
from naisr_model.surface.fields import LEAST_SLOPE

CHUNK = 512
"""Points evaluated together: their activations stay in the processor's cache."""


class Sensitivity(NamedTuple):
    """First-order distances and their derivatives, in model units.

    Attributes:
        distances: Phi / |grad Phi|, ``[n]``.
        jacobian: by the covariates and then by the code, |grad Phi| held constant, ``[n, N + L]``.
        normals: by the point's own place, grad Phi / |grad Phi|, ``[n, dim]``.
    """

    distances: Tensor
    jacobian: Tensor
    normals: Tensor


def sensitivity(model: ShapeModel, points: Tensor, covariates: Tensor, latent: Tensor) -> Sensitivity:
    """Distances of points to one shape and their derivatives by its parameters.

    With r = Phi / |grad Phi|, dr/dtheta = (dPhi/dtheta) / |grad Phi|: what the slope itself
    contributes is multiplied by r and vanishes on the surface.

    Args:
        model: trained.
        points: ``[n, dim]``.
        covariates: centred, ``[N]``.
        latent: ``[L]``.
    """
    parts = [_sensitivity(model, chunk, covariates, latent) for chunk in points.split(CHUNK)]
    return Sensitivity(*(torch.cat(columns) for columns in zip(*parts, strict=True)))


def _sensitivity(model: ShapeModel, points: Tensor, covariates: Tensor, latent: Tensor) -> Sensitivity:
    own = [points[:, None], *(vector.expand(len(points), -1) for vector in (covariates, latent))]
    own = [tensor.detach().clone().requires_grad_() for tensor in own]
    with torch.enable_grad():
        values = model(*own)
        # A model may have no use for covariates.
        derivatives = torch.autograd.grad(values.sum(), own, materialize_grads=True)
    slopes, by_covariates, by_latent = derivatives
    steepness = slopes.norm(dim=-1).clamp(min=LEAST_SLOPE)
    jacobian = torch.cat([by_covariates, by_latent], dim=-1) / steepness
    normals = slopes[:, 0] / steepness
    return Sensitivity(values.detach()[:, 0] / steepness[:, 0], jacobian, normals)
