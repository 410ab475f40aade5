"""The whole loss of a batch: which fields are evaluated where, and the weighted sum of terms."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from naisr_model.config import LossWeights
from naisr_model.learning.training import losses
from naisr_model.models.base import ShapeModel, deformable, disentangled
from naisr_model.models.derivatives import deformation_determinant


class Batch(NamedTuple):
    """Samples of some shapes in model units.

    Attributes:
        surface_points: ``[shapes, n_on, dim]``.
        surface_normals: outward unit normals, ``[shapes, n_on, dim]``.
        space_points: off the surface, ``[shapes, n_off, dim]``.
        space_sdf: signed distances there, ``[shapes, n_off]``.
    """

    surface_points: Tensor
    surface_normals: Tensor
    space_points: Tensor
    space_sdf: Tensor

    @classmethod
    def from_arrays(cls, *arrays: object, device: torch.device | str = "cpu") -> Batch:
        """The four arrays as tensors on ``device``."""
        return cls(*(torch.as_tensor(array, device=device) for array in arrays))

    def narrow(self, shapes: slice) -> Batch:
        """Some of the shapes."""
        return Batch(*(part[shapes] for part in self))


def reconstruction_terms(
    model: ShapeModel, batch: Batch, covariates: Tensor, latents: Tensor, weights: LossWeights
) -> dict[str, Tensor]:
    """The weighted terms L_on and L_off of a batch, and the folding term where it is asked for.

    On- and off-surface points go through the networks together, so that they are evaluated once.

    Raises:
        InputError: for the folding of a model that deforms no template.
    """
    on = batch.surface_points.shape[1]
    points = torch.cat([batch.surface_points, batch.space_points], dim=1)
    values, slope, template_slope, displacement, underway = model.linearised(points, covariates, latents)
    terms = {
        "surface_distance": weights.surface_distance * losses.distance(values[:, :on], 0.0),
        "surface_normal": weights.surface_normal * losses.normal(slope[:, :on], batch.surface_normals),
    }
    if weights.surface_eikonal:
        terms["surface_eikonal"] = weights.surface_eikonal * losses.eikonal(slope[:, :on])
    if weights.space_distance:
        terms["space_distance"] = weights.space_distance * losses.distance(values[:, on:], batch.space_sdf)
    if weights.space_eikonal:
        terms["space_eikonal"] = weights.space_eikonal * losses.eikonal(slope[:, on:])
    if weights.template_eikonal:
        assert template_slope is not None  # no other model is trained with this term, nor with those below
        terms["template_eikonal"] = weights.template_eikonal * losses.eikonal(template_slope)
    if weights.first_order:
        terms["first_order"] = weights.first_order * losses.first_order_distance(
            values[:, on:], slope[:, on:], batch.space_sdf, weights.first_order_reach
        )
    if weights.underway:
        assert underway is not None
        distances = torch.cat([torch.zeros_like(values[:, :on]), batch.space_sdf], dim=1)
        terms["underway"] = weights.underway * losses.underway(underway, distances)
    if weights.pointwise:
        assert displacement is not None
        terms["pointwise"] = weights.pointwise * losses.pointwise(displacement)
    if weights.pointpair:
        assert displacement is not None
        terms["pointpair"] = weights.pointpair * losses.pointpair(displacement, points)
    if weights.folding:
        located = batch.surface_points.requires_grad_()
        there = deformable(model).displacement(located, covariates, latents)
        determinant = deformation_determinant(there, located)
        terms["folding"] = weights.folding * losses.folding(determinant)
    return terms


def population_terms(
    model: ShapeModel, points: Tensor, covariates: Tensor, binary: tuple[int, ...], weights: LossWeights
) -> dict[str, Tensor]:
    """What settles the effects where the data leave them open, at z = 0.

    Args:
        model: is trained.
        points: ``[shapes, n, dim]``.
        covariates: of those shapes, ``[shapes, N]``.
        binary: columns of ``covariates`` that only ever are -1 or +1.
        weights: ``centring`` and ``ridge`` are used.

    Raises:
        InputError: for a term of displacements that the model does not have.
    """
    latents = covariates.new_zeros(len(covariates), model.config.latent)
    terms: dict[str, Tensor] = {}
    if weights.ridge:
        displacements = disentangled(model).displacements(points, covariates, latents)
        terms["ridge"] = weights.ridge * losses.ridge(displacements)
    if weights.centring and binary:
        levels = torch.cat([-torch.ones_like(covariates), torch.ones_like(covariates)])
        both = disentangled(model).displacements(points.repeat(2, 1, 1), levels, latents.repeat(2, 1))
        terms["centring"] = weights.centring * losses.centring(*both[list(binary)].chunk(2, dim=1))
    return terms


def latent_term(latents: Tensor, weights: LossWeights) -> dict[str, Tensor]:
    """The weighted prior on the codes."""
    return {"latent": weights.latent * losses.latent_prior(latents, weights.latent_sigma)}
