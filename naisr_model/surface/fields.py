"""The fields of trained models as plain functions of points, ready for a lattice."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from naisr_model.models.base import DeformableModel, PointFunction, ShapeModel
from naisr_model.surface.sparse import Field

LEAST_SLOPE = 0.3
"""Below this slope (on medial axes) Phi / |grad Phi| says nothing about a distance."""


def template_field(model: DeformableModel) -> Field:
    """T in model units."""
    return _field(model, lambda points: model.template(points[None])[0])


def shape_field(model: ShapeModel, covariates: Tensor, latent: Tensor) -> Field:
    """Phi at ``covariates [N]`` (centred) and ``latent [L]``, in model units."""
    return _field(model, model.shape_function(covariates, latent))


def effect_field(model: ShapeModel, index: int, covariates: Tensor, latent: Tensor) -> Field:
    """Phi_i of the covariate ``index``, in model units: Phi with the other covariates at 0."""
    alone = torch.zeros_like(covariates)
    alone[index] = covariates[index]
    return shape_field(model, alone, latent)


def distances(
    model: ShapeModel, points: NDArray[np.float32], covariates: Tensor, latent: Tensor
) -> NDArray[np.float32]:
    """Phi / |grad Phi|, the distance to the zero level set to first order, ``[n]`` in model units.

    Phi itself is a distance only as far as the training made it one: where the template is shrunk,
    Phi is steeper than a distance.
    """
    located = _located(model, points).requires_grad_()
    values = model(located, covariates[None], latent[None])
    (gradient,) = torch.autograd.grad(values.sum(), located)
    slope = gradient.norm(dim=-1).clamp(min=LEAST_SLOPE)
    return (values / slope)[0].numpy(force=True)


def _field(model: ShapeModel, function: PointFunction) -> Field:
    def field(points: NDArray[np.float32]) -> NDArray[np.float32]:
        with torch.inference_mode():
            return function(torch.from_numpy(points).to(model.device)).numpy(force=True)

    return field


def _located(model: ShapeModel, points: NDArray[np.float32]) -> Tensor:
    """``points [n, dim]`` as the only shape of a batch, where the model is."""
    return torch.from_numpy(points)[None].to(model.device)
