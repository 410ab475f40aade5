"""Whether an atlas is sound, with no truth to ask: shapes of one piece, no folds, a steady template."""

from __future__ import annotations

import itertools

import numpy as np
import torch

from naisr_model.atlas import Atlas
from naisr_model.covariates import Values
from naisr_model.evaluation.metrics import component_count
from naisr_model.evaluation.truth import EFFECT_VALUES
from naisr_model.models.base import additive, deformable
from naisr_model.progress import SILENT, Progress
from naisr_model.shapes.kinds import Shape
from naisr_model.surface.folding import folded_shares

FOLDING_SHAPES, FOLDING_RESOLUTION = 40, 64


def surface_places(atlas: Atlas) -> dict[str, list[dict[str, float]]]:
    """Where surfaces at z = 0 have to be one piece, and where there are no data.

    Returns:
        ``plausible``, every training covariate vector and each slider from end to end with the others at
        their mean, binary ones at each level where shapes between them are not known; and ``corners``, those
        of the box of ranges. Where shapes do not depend on covariates there is one surface and no corner.
    """
    if not atlas.capabilities.evolvable:
        return {"plausible": [{}], "corners": []}
    population = atlas.population
    training = [population.row(int(row)) for row in np.flatnonzero(~population.held_out)]
    can = atlas.capabilities
    binary = [] if can.vanishes_at_centre else [one for one in atlas.covariates if one.kind == "binary"]
    levels = [
        dict(zip((one.name for one in binary), map(float, chosen), strict=True))
        for chosen in itertools.product(*(one.range for one in binary))
    ]
    sliders = [
        {**others, covariate.name: float(value)}
        for others in levels
        for covariate in atlas.covariates
        for value in np.linspace(*covariate.range, 2 * EFFECT_VALUES)
    ]
    ranges = [covariate.range for covariate in atlas.covariates]
    corners = [
        dict(zip(population.names, map(float, corner), strict=True)) for corner in itertools.product(*ranges)
    ]
    return {"plausible": [*training, *sliders], "corners": corners}


def components(atlas: Atlas, values: Values, resolution: int, progress: Progress = SILENT) -> int:
    """Connected components of the surface at some covariates and z = 0."""
    return component_count(atlas.shape(values, resolution=resolution, extrapolate=True, progress=progress))


def folded_share(atlas: Atlas) -> float:
    """Mean share of folded points near the surfaces of training shapes with their codes, z = 0 included."""
    model, people = deformable(atlas.checkpoint.model()), atlas.population
    vectors = people.normalised()[~people.held_out]
    some = np.random.default_rng(0).permutation(len(vectors))[:FOLDING_SHAPES]
    covariates = torch.as_tensor(np.concatenate([vectors[some]] * 2), dtype=torch.float32)
    latents = torch.as_tensor(atlas.checkpoint.latents[some])
    both = torch.cat([latents, torch.zeros_like(latents)])
    return float(np.nanmean(folded_shares(model, covariates, both, FOLDING_RESOLUTION)))


def mean_displacement_mm(atlas: Atlas, surface_mm: Shape) -> dict[str, float]:
    """Length of the population's mean displacement of each covariate at z = 0, averaged over a surface.

    The template stands where the mean shape stands only if nobody's displacement is everybody's.
    """
    model, frame = additive(atlas.checkpoint.model()), atlas.frame
    points = frame.to_model(surface_mm.sample(500, seed=0))
    vectors = atlas.population.normalised()[~atlas.population.held_out]
    total = torch.zeros(len(atlas.covariates), len(points), frame.dim)
    for vector in torch.as_tensor(vectors, dtype=torch.float32):
        with torch.inference_mode():
            total += model.displacements(
                torch.as_tensor(points, dtype=torch.float32)[None],
                vector[None],
                torch.zeros(1, model.config.latent),
            )[:, 0]
    lengths = (total / len(vectors)).norm(dim=-1).mean(dim=-1) * frame.scale_mm
    return dict(zip(atlas.population.names, map(float, lengths), strict=True))
