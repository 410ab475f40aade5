"""The loss terms, each a pure function of fields already evaluated; means over shapes and points.

Equations of section "Training" of Jiao et al. (ICLR 2024). All lengths are in model units.
"""

from __future__ import annotations

import torch
from torch import Tensor

from naisr_model.surface.fields import LEAST_SLOPE

TOLERANCES = 0.025, 0.01, 0.0025
"""Model units by which the template may be wrong after each of the steps that are judged underway."""

HARDNESS = 0.0, 0.1, 0.2
"""By how much a point on the wrong side, or too near to it, counts for more there."""

SHORT = 0.25
"""Model units up to which the length of a displacement counts squared."""

ALIKE = 0.5
"""How much two displacements may differ, per distance of their points."""

SMOOTHED_LENGTH = 1e-4
"""Model units below which a length is smoothed to a square, so that its gradient exists at 0."""


def eikonal(gradient: Tensor) -> Tensor:
    """L_Eikonal: mean of | |grad Phi| - 1 |; ``gradient [..., n, dim]``."""
    return (gradient.norm(dim=-1) - 1).abs().mean()


def distance(predicted: Tensor, target: Tensor | float) -> Tensor:
    """L_Dirichlet: mean of |Phi - s|; ``target`` is 0 on the surface."""
    return (predicted - target).abs().mean()


def first_order_distance(predicted: Tensor, gradient: Tensor, target: Tensor, reach: float) -> Tensor:
    """Mean of |Phi / |grad Phi| - s| / (1 + |s| / reach).

    Phi / |grad Phi| is the distance to the zero level set to first order (Taubin 1991). Where a
    deformation shrinks the template to a third, Phi grows three times as fast as a distance does:
    L_Dirichlet and L_Eikonal then pull against the right size, this term does not. Errors count
    in full near the surface and relative to the distance far beyond ``reach``.

    Args:
        predicted: Phi, ``[..., n]``.
        gradient: its gradient, ``[..., n, dim]``.
        target: signed distance s, ``[..., n]``.
        reach: in model units.
    """
    distances = predicted / gradient.norm(dim=-1).clamp(min=LEAST_SLOPE)
    return ((distances - target).abs() / (1 + target.abs() / reach)).mean()


def normal(gradient: Tensor, normals: Tensor) -> Tensor:
    """L_Neumann: mean of 1 - cos(grad Phi, n); both ``[..., n, dim]``."""
    return (1 - torch.cosine_similarity(gradient, normals, dim=-1)).mean()


def latent_prior(latents: Tensor, sigma: float) -> Tensor:
    """L_lat without its weight: mean over shapes of |z|^2 / (L sigma^2); ``latents [shapes, L]``."""
    return latents.square().mean() / sigma**2


def centring(at_minus: Tensor, at_plus: Tensor) -> Tensor:
    """Mean length of the offset that a binary covariate's two displacements share.

    The length, not its square: a tube's calibre doubles within offsets whose square is nothing.

    Args:
        at_minus: displacements at -1, ``[..., n, dim]``.
        at_plus: displacements at +1, ``[..., n, dim]``.
    """
    squared = ((at_minus + at_plus) / 2).square().sum(dim=-1)
    return (squared + SMOOTHED_LENGTH**2).sqrt().mean() - SMOOTHED_LENGTH


def ridge(displacements: Tensor) -> Tensor:
    """Mean squared length of displacements; ``[..., n, dim]``."""
    return displacements.square().sum(dim=-1).mean()


def folding(determinant: Tensor) -> Tensor:
    """Mean of max(0, -det(I + grad d)): positive only where the deformation folds."""
    return torch.relu(-determinant).mean()


def underway(predicted: Tensor, target: Tensor) -> Tensor:
    """The curriculum of DIT (Zheng et al. 2021; Duan et al. 2020): every step has to be nearer than the last.

    Args:
        predicted: T after each of the steps that are judged, ``[steps, shapes, n]``.
        target: signed distance s, ``[shapes, n]``.
    """
    wrong = (target - predicted).sign() * target.sign()
    steps = zip(predicted, wrong, TOLERANCES, HARDNESS, strict=True)
    return torch.stack(
        [
            (torch.relu((step - target).abs() - tolerance) * (1 + hardness * side)).mean()
            for step, side, tolerance, hardness in steps
        ]
    ).mean()


def pointwise(displacement: Tensor) -> Tensor:
    """Mean Huber function of the displacements' lengths, from DIT; ``[..., n, dim]``."""
    lengths = (displacement.square().sum(dim=-1) + SMOOTHED_LENGTH**2).sqrt()
    return torch.nn.functional.huber_loss(lengths, torch.zeros_like(lengths), delta=SHORT)


def pointpair(displacement: Tensor, points: Tensor) -> Tensor:
    """Mean of max(0, |d_i - d_j| / |p_i - p_j| - 1/2), from DIT, over points that were drawn one by one.

    Args:
        displacement: d, ``[shapes, n, dim]``.
        points: p, ``[shapes, n, dim]``.
    """
    apart, differing = (values - values.roll(1, dims=1) for values in (points, displacement))
    differences = (differing.square().sum(dim=-1) + SMOOTHED_LENGTH**2).sqrt()
    return torch.relu(differences / apart.norm(dim=-1).clamp(min=SMOOTHED_LENGTH) - ALIKE).mean()
