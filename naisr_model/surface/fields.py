"""The fields of trained networks as plain functions of points, ready for a lattice."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from naisr_model.networks.calculus import deformation_determinant, gradient
from naisr_model.networks.naisr import Naisr
from naisr_model.surface.sparse import Field

LEAST_SLOPE = 0.3
"""Below this slope (on medial axes) Phi / |grad Phi| says nothing about a distance."""


def template_field(network: Naisr) -> Field:
    """T in model units."""

    def field(points: NDArray[np.float32]) -> NDArray[np.float32]:
        with torch.inference_mode():
            return network.template(torch.from_numpy(points)[None])[0].numpy()

    return field


def shape_field(network: Naisr, covariates: Tensor, latent: Tensor) -> Field:
    """Phi at ``covariates [N]`` (centred) and ``latent [L]``, in model units."""

    def field(points: NDArray[np.float32]) -> NDArray[np.float32]:
        with torch.inference_mode():
            values, _ = network(torch.from_numpy(points)[None], covariates[None], latent[None])
        return values[0].numpy()

    return field


def effect_field(network: Naisr, index: int, covariates: Tensor, latent: Tensor) -> Field:
    """Phi_i of the covariate ``index``, in model units."""

    def field(points: NDArray[np.float32]) -> NDArray[np.float32]:
        with torch.inference_mode():
            values = network.effect(index, torch.from_numpy(points)[None], covariates[None], latent[None])
        return values[0].numpy()

    return field


def distances(
    network: Naisr, points: NDArray[np.float32], covariates: Tensor, latent: Tensor
) -> NDArray[np.float32]:
    """Phi / |grad Phi|, the distance to the zero level set to first order, ``[n]`` in model units.

    Phi itself is a distance only as far as the training made it one: where the template is shrunk,
    Phi is steeper than a distance.
    """
    located = torch.from_numpy(points)[None].requires_grad_()
    values, _ = network(located, covariates[None], latent[None])
    slope = gradient(values, located).norm(dim=-1).clamp(min=LEAST_SLOPE)
    return (values / slope)[0].numpy(force=True)


def folded(
    network: Naisr, points: NDArray[np.float32], covariates: Tensor, latent: Tensor
) -> NDArray[np.bool_]:
    """Where p -> p + d(p) folds, that is det(I + grad d) <= 0; ``[n]`` for ``points [n, dim]``."""
    located = torch.from_numpy(points)[None].requires_grad_()
    _, displacement = network(located, covariates[None], latent[None])
    return (deformation_determinant(displacement, located)[0] <= 0).numpy(force=True)
