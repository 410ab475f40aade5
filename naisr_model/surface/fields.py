"""The fields of trained networks as plain functions of points, ready for a lattice."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from naisr_model.models.naisr.inference import PointFunction, shape_function
from naisr_model.models.naisr.network import Naisr
from naisr_model.surface.sparse import Field

LEAST_SLOPE = 0.3
"""Below this slope (on medial axes) Phi / |grad Phi| says nothing about a distance."""


def template_field(network: Naisr) -> Field:
    """T in model units."""
    return _field(network, lambda points: network.template(points[None])[0])


def shape_field(network: Naisr, covariates: Tensor, latent: Tensor) -> Field:
    """Phi at ``covariates [N]`` (centred) and ``latent [L]``, in model units."""
    return _field(network, shape_function(network, covariates, latent))


def effect_field(network: Naisr, index: int, covariates: Tensor, latent: Tensor) -> Field:
    """Phi_i of the covariate ``index``, in model units: Phi with the other covariates at 0."""
    alone = torch.zeros_like(covariates)
    alone[index] = covariates[index]
    return shape_field(network, alone, latent)


def distances(
    network: Naisr, points: NDArray[np.float32], covariates: Tensor, latent: Tensor
) -> NDArray[np.float32]:
    """Phi / |grad Phi|, the distance to the zero level set to first order, ``[n]`` in model units.

    Phi itself is a distance only as far as the training made it one: where the template is shrunk,
    Phi is steeper than a distance.
    """
    located = _located(network, points).requires_grad_()
    values, _ = network(located, covariates[None], latent[None])
    (gradient,) = torch.autograd.grad(values.sum(), located)
    slope = gradient.norm(dim=-1).clamp(min=LEAST_SLOPE)
    return (values / slope)[0].numpy(force=True)


def _field(network: Naisr, function: PointFunction) -> Field:
    def field(points: NDArray[np.float32]) -> NDArray[np.float32]:
        with torch.inference_mode():
            return function(torch.from_numpy(points).to(network.device)).numpy(force=True)

    return field


def _located(network: Naisr, points: NDArray[np.float32]) -> Tensor:
    """``points [n, dim]`` as the only shape of a batch, where the network is."""
    return torch.from_numpy(points)[None].to(network.device)
