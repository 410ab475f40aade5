"""Where the deformation folds: the paper names missing invertibility as its limit, so it is measured."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from naisr_model.frames import Frame
from naisr_model.models.base import DeformableModel
from naisr_model.models.derivatives import deformation_determinant
from naisr_model.surface.fields import shape_field
from naisr_model.surface.isosurface import isosurface
from naisr_model.surface.lattice import Lattice
from naisr_model.surface.sparse import evaluate_band

POINTS, SPREAD = 2000, 0.01
"""Points a shape, and how far they are spread about its surface (standard deviation, model units)."""


def folded_shares(
    model: DeformableModel, covariates: Tensor, latents: Tensor, resolution: int
) -> NDArray[np.float64]:
    """Share of the points near each surface where p -> p + d(p) folds, det(I + grad d) <= 0.

    Args:
        model: trained.
        covariates: centred, ``[shapes, N]``.
        latents: codes, ``[shapes, L]``.
        resolution: cells along a side of the box for the surfaces.

    Returns:
        ``[shapes]``; NaN where there is no surface.
    """
    dim = model.config.dim
    lattice, rng = Lattice(resolution, dim), np.random.default_rng(0)
    shares = []
    for vector, latent in zip(covariates, latents, strict=True):
        values = evaluate_band(shape_field(model, vector, latent), lattice)
        surface = isosurface(values, lattice, Frame((0.0,) * dim, 1.0))
        if not len(surface.faces):
            shares.append(np.nan)
            continue
        near = surface.sample(POINTS, seed=0) + rng.normal(0, SPREAD, (POINTS, dim))
        shares.append(folded(model, near.astype(np.float32), vector, latent).mean())
    return np.array(shares)


def folded(
    model: DeformableModel, points: NDArray[np.float32], covariates: Tensor, latent: Tensor
) -> NDArray[np.bool_]:
    """Where p -> p + d(p) folds, ``[n]`` for ``points [n, dim]`` in model units."""
    located = torch.from_numpy(points)[None].to(model.device).requires_grad_()
    displacement = model.displacement(located, covariates[None], latent[None])
    return (deformation_determinant(displacement, located)[0] <= 0).numpy(force=True)
