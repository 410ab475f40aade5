"""Derivatives of fields with respect to the query points."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from naisr_model.models.naisr.network import Naisr


def gradient(values: Tensor, points: Tensor) -> Tensor:
    """Spatial gradient of a scalar field, differentiable again.

    Args:
        values: the field at ``points``, ``[..., n]``; each value depends on its own point only.
        points: ``[..., n, dim]`` with ``requires_grad``.

    Returns:
        ``[..., n, dim]``, in units of the field per unit of the points.
    """
    (result,) = torch.autograd.grad(values.sum(), points, create_graph=True)
    return result


class Linearised(NamedTuple):
    """The full shape's field and what its losses need of its derivatives, model units.

    Attributes:
        values: Phi, ``[shapes, n]``.
        slope: grad Phi with respect to the points, ``[shapes, n, dim]``.
        template_slope: grad T at the deformed points, ``[shapes, n, dim]``.
        displacement: sum_i g_i, ``[shapes, n, dim]``.
    """

    values: Tensor
    slope: Tensor
    template_slope: Tensor
    displacement: Tensor


def linearised(network: Naisr, points: Tensor, covariates: Tensor, latents: Tensor) -> Linearised:
    """Phi and grad Phi = (I + grad d)^T grad T at p + d(p), by the chain rule written out.

    A loss of these needs one backward pass, not one through the graph of another.

    Args:
        network: the networks.
        points: ``[shapes, n, dim]``.
        covariates: ``[shapes, N]``.
        latents: ``[shapes, L]``.
    """
    shapes = len(points)
    conditions = network.conditions(covariates, latents)
    at_both, bends = network.displacement_networks.traced(points.repeat(2, 1, 1), conditions)
    at_value, at_zero = at_both.split(shapes, dim=1)
    displacement = (at_value - at_zero).sum(dim=0)
    values, slopes = network.template_network.traced(points + displacement)
    template_slope = network.template_network.pulled_back(torch.ones_like(values), slopes)[0]
    outer = torch.cat([template_slope, -template_slope]).expand(len(conditions), -1, -1, -1)
    bent = network.displacement_networks.pulled_back(outer, bends).sum(dim=0)
    slope = template_slope + bent[:shapes] + bent[shapes:]
    return Linearised(values[0, :, :, 0], slope, template_slope, displacement)


def jacobian(vectors: Tensor, points: Tensor) -> Tensor:
    """Jacobian of a vector field, differentiable again.

    Args:
        vectors: the field at ``points``, ``[..., n, k]``.
        points: ``[..., n, dim]`` with ``requires_grad``.

    Returns:
        ``[..., n, k, dim]``; row ``i`` is the gradient of component ``i``.
    """
    return torch.stack([gradient(vectors[..., i], points) for i in range(vectors.shape[-1])], dim=-2)


def deformation_determinant(displacement: Tensor, points: Tensor) -> Tensor:
    """det(I + grad d), ``[..., n]``: at most 0 where the map p -> p + d(p) folds."""
    identity = torch.eye(points.shape[-1], dtype=points.dtype, device=points.device)
    return torch.linalg.det(identity + jacobian(displacement, points))
