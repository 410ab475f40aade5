"""What the covariates do to a surface, point by point and along its outward normal n = grad Phi / |grad Phi|.

The material point at p has come from the template's q = p + d(p), by -d(p) . n along the normal. As long as
Phi = T(p + d(p)) keeps its value there, it moves with c_i along the normal at the speed of the level set,

    -(dPhi/dc_i) / |grad Phi|.
"""

from __future__ import annotations

import torch
from torch import Tensor

from naisr_model.models.base import DeformableModel, ShapeModel
from naisr_model.models.derivatives import gradient

LEAST_SLOPE = 1e-6
"""Of Phi; where it is as good as flat it bounds no surface."""


def travelled(model: DeformableModel, points: Tensor, covariates: Tensor, latent: Tensor) -> Tensor:
    """How far the material points at ``points [n, dim]`` of a shape have come along its normals, ``[n]``.

    Args:
        model: whose d it is.
        points: on the shape, model units.
        covariates: c, centred, ``[N]``.
        latent: z, ``[L]``.

    Returns:
        Model units, positive outwards.
    """
    located = points.detach()[None].requires_grad_()
    displaced = model.displacement(located, covariates[None], latent[None])
    normals = _normals(gradient(model.template(located + displaced), located))
    return -(displaced * normals).sum(dim=-1)[0].detach()


def rates(model: ShapeModel, points: Tensor, covariates: Tensor, latent: Tensor, index: int) -> Tensor:
    """How fast the surface moves along its normals with c_i at ``points [n, dim]``, ``[n]``.

    The derivative is taken forwards, as one of a derivative backwards: with weights w, of
    sum_k w_k dPhi_k/dc_i that by w_k is dPhi_k/dc_i.

    Args:
        model: whose Phi it is.
        points: on the shape, model units.
        covariates: c, centred, ``[N]``.
        latent: z, ``[L]``.
        index: i.

    Returns:
        Model units per unit of c_i, positive outwards.
    """
    located, given = points.detach()[None].requires_grad_(), covariates.detach()[None].requires_grad_()
    distances = model(located, given, latent[None])
    slopes = gradient(distances, located).detach().norm(dim=-1)
    weights = torch.zeros_like(distances, requires_grad=True)
    (weighted,) = torch.autograd.grad((weights * distances).sum(), given, create_graph=True)
    (speeds,) = torch.autograd.grad(weighted[0, index], weights)
    return -(speeds / slopes.clamp(min=LEAST_SLOPE))[0].detach()


def outward(model: ShapeModel, points: Tensor, covariates: Tensor, latent: Tensor) -> Tensor:
    """The unit normals n at ``points [n, dim]`` of a shape, ``[n, dim]``."""
    located = points.detach()[None].requires_grad_()
    return _normals(gradient(model(located, covariates[None], latent[None]), located))[0]


def _normals(slopes: Tensor) -> Tensor:
    return (slopes / slopes.norm(dim=-1, keepdim=True).clamp(min=LEAST_SLOPE)).detach()
