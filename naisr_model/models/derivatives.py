"""Derivatives of fields with respect to the query points."""

from __future__ import annotations

import torch
from torch import Tensor


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
