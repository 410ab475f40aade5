"""The derivatives that the losses of NAISR need, by the chain rule written out."""

from __future__ import annotations

import torch
from torch import Tensor

from naisr_model.models.base import Linearised
from naisr_model.models.siren import SirenStack


def linearised(
    template: SirenStack, displacements: SirenStack, points: Tensor, conditions: Tensor
) -> Linearised:
    """Phi, grad Phi = (I + grad d)^T grad T at p + d(p), and d.

    A loss of these needs one backward pass, not one through the graph of another.

    Args:
        template: T.
        displacements: f_1 ... f_N.
        points: ``[shapes, n, dim]``.
        conditions: see :func:`conditions`, ``[N, 2 * shapes, 1 + L]``.
    """
    shapes = len(points)
    at_both, bends = displacements.traced(points.repeat(2, 1, 1), conditions)
    at_value, at_zero = at_both.split(shapes, dim=1)
    displacement = (at_value - at_zero).sum(dim=0)
    values, slopes = template.traced(points + displacement)
    template_slope = template.pulled_back(torch.ones_like(values), slopes)[0]
    outer = torch.cat([template_slope, -template_slope]).expand(len(conditions), -1, -1, -1)
    bent = displacements.pulled_back(outer, bends).sum(dim=0)
    slope = template_slope + bent[:shapes] + bent[shapes:]
    return Linearised(values[0, :, :, 0], slope, template_slope, displacement)


def conditions(covariates: Tensor, latents: Tensor) -> Tensor:
    """What the f_i see beside the points: (c_i, z) of every shape, then (0, z).

    Args:
        covariates: ``[shapes, N]``.
        latents: ``[shapes, L]``.

    Returns:
        ``[N, 2 * shapes, 1 + L]``.
    """
    codes = latents.expand(covariates.shape[1], *latents.shape)
    at_value = torch.cat([covariates.T[..., None], codes], dim=-1)
    at_zero = torch.cat([torch.zeros_like(covariates).T[..., None], codes], dim=-1)
    return torch.cat([at_value, at_zero], dim=1)
