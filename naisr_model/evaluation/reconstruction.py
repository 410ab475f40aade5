"""Is an atlas true? Held-out shapes refitted, and where the population is synthetic, its effects checked."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import numpy as np
import torch
import trimesh
from numpy.typing import NDArray

from naisr_model.atlas import Atlas
from naisr_model.config import FitConfig
from naisr_model.covariates import Covariate, Population, normalised_vector
from naisr_model.data.align import rigid_transform
from naisr_model.data.populations import population as population_module
from naisr_model.data.samples import ShapeSamples, sample_shape
from naisr_model.data.store import SampleStore
from naisr_model.errors import InputError
from naisr_model.evaluation.metrics import compare, component_count, hausdorff_x100
from naisr_model.evaluation.tables import TruthPoint, reconstruction_report
from naisr_model.learning.fit import fit_latents
from naisr_model.learning.objective import Batch
from naisr_model.surface.fields import folded

Progress = Callable[[float], None]
StopCheck = Callable[[], bool]

SAMPLES_OF_A_FIT = 20_000
NEIGHBOURS, NEIGHBOUR_DISTANCE = 3, 0.25
EFFECT_VALUES = 9
FOLDING_SHAPES, FOLDING_POINTS = 40, 2000
FITTED_AT_ONCE = 4
"""Shapes fitted together: their activations stay in the processor's cache."""


@dataclass(frozen=True)
class EvaluationConfig:
    """What an evaluation costs.

    Attributes:
        fit: how the codes of held-out shapes are found, their covariates being known.
        resolution: of the surfaces that are measured.
        check_resolution: of the many surfaces whose components are counted.
        limit: at most so many held-out shapes; 0 takes all.
    """

    fit: FitConfig = field(default_factory=lambda: FitConfig(steps=200, surface_points=128, space_points=128))
    resolution: int = 128
    check_resolution: int = 96
    limit: int = 0


@dataclass(frozen=True, eq=False)
class HeldOut:
    """One shape that the training never saw, in the atlas frame."""

    values: dict[str, float]
    mesh_mm: trimesh.Trimesh


def evaluate(
    atlas: Atlas,
    config: EvaluationConfig,
    store: SampleStore | None = None,
    *,
    progress: Progress | None = None,
    should_stop: StopCheck | None = None,
) -> dict[str, Any]:
    """Everything that ``naisr evaluate reconstruction`` prints, see ``tables.reconstruction_report``.

    Held-out shapes come from ``store``; without one the synthetic population that the atlas records
    as its source is made again from its seed. Effects are compared with the truth where the source
    is synthetic, and only at covariates that the training data make plausible.

    Raises:
        InputError: when there are no held-out shapes to be had.
        Cancelled: when ``should_stop()`` turned true.
    """
    shapes = held_out_shapes(atlas, store, config.limit or None)
    latents = fit_all(atlas, shapes, config.fit, _part(progress, 0.0, 0.7), should_stop)
    distances, components = [], []
    for done, (shape, latent) in enumerate(zip(shapes, latents, strict=True), start=1):
        fitted = atlas.shape(
            shape.values, latent, config.resolution, extrapolate=True, should_stop=should_stop
        )
        distances.append(compare(shape.mesh_mm, fitted))
        components.append(component_count(fitted))
        _tell(progress, 0.7 + 0.15 * done / len(shapes))
    growth, effects = truth_points(atlas, config.resolution)
    _tell(progress, 0.9)
    components += [component_count(mesh) for mesh in _population_shapes(atlas, config.check_resolution)]
    report = reconstruction_report(
        distances,
        components=components,
        folded_share=folded_share(atlas, config.check_resolution),
        growth=growth,
        effects=effects,
    )
    corners = [component_count(mesh) for mesh in _corner_shapes(atlas, config.check_resolution)]
    report["corner_components"] = [min(corners), max(corners)]
    report["template"] = _template_volume(atlas, config.resolution)
    _tell(progress, 1.0)
    return report


def held_out_shapes(atlas: Atlas, store: SampleStore | None, limit: int | None = None) -> list[HeldOut]:
    """The first held-out shapes of a store, or of the synthetic population that the atlas was made from.

    Raises:
        InputError: when the atlas was made from somebody's own data and no store is given.
    """
    if store is not None:
        rows = np.flatnonzero(store.population.held_out)[:limit]
        return [HeldOut(store.population.row(int(row)), store.mesh(int(row))) for row in rows]
    module = _synthetic(atlas)
    if module is None:
        raise InputError(
            "this atlas was made from data of your own; give the store it was trained on with --store"
        )
    source, population = atlas.checkpoint.source, atlas.population
    held_out = {
        (population.subjects[row], population.visits[row])
        for row in np.flatnonzero(population.held_out)[:limit]
    }
    visits = module.visits(int(source["seed"]), int(source["patients"]))
    return [
        HeldOut(dict(visit.values), _aligned(atlas, *module.visit_shape(visit)))
        for visit in visits
        if (visit.subject, visit.visit) in held_out
    ]


def _synthetic(atlas: Atlas) -> ModuleType | None:
    name = atlas.checkpoint.source.get("population")
    return population_module(str(name)) if name else None


def _aligned(
    atlas: Atlas, mesh: trimesh.Trimesh, landmarks: dict[str, tuple[float, float, float]]
) -> trimesh.Trimesh:
    moved = mesh.copy()
    moved.apply_transform(rigid_transform(atlas.checkpoint.alignment, mesh, landmarks))
    return moved


def fit_all(
    atlas: Atlas,
    shapes: Sequence[HeldOut],
    config: FitConfig,
    progress: Progress | None = None,
    should_stop: StopCheck | None = None,
) -> NDArray[np.float32]:
    """Codes of all shapes at their known covariates, ``[n, L]``."""
    network, codes = atlas.checkpoint.network(), []
    for start in range(0, len(shapes), FITTED_AT_ONCE):
        chosen = shapes[start : start + FITTED_AT_ONCE]
        samples = [
            sample_shape(shape.mesh_mm, atlas.frame, *(SAMPLES_OF_A_FIT,) * 3, seed=config.seed)
            for shape in chosen
        ]
        vectors = np.stack([normalised_vector(atlas.covariates, shape.values) for shape in chosen])
        share = _part(progress, start / len(shapes), (start + len(chosen)) / len(shapes))
        codes.append(
            fit_latents(
                network,
                lambda rng, samples=samples: _draw(samples, config, rng),  # type: ignore[misc]
                torch.as_tensor(vectors, dtype=torch.float32),
                config,
                atlas.checkpoint.preset.training.loss,
                progress=share,
                should_stop=should_stop,
            ).numpy()
        )
    return np.concatenate(codes)


def _draw(samples: Sequence[ShapeSamples], config: FitConfig, rng: np.random.Generator) -> Batch:
    half = config.space_points // 2
    picks = [rng.integers(0, SAMPLES_OF_A_FIT, count) for count in (config.surface_points, half, half)]
    surface = np.stack([item.surface[picks[0]] for item in samples])
    space = np.stack([np.concatenate([item.near[picks[1]], item.uniform[picks[2]]]) for item in samples])
    dim = space.shape[-1] - 1
    return Batch.from_arrays(surface[..., :dim], surface[..., dim:], space[..., :dim], space[..., dim])


def truth_points(atlas: Atlas, resolution: int) -> tuple[list[TruthPoint], list[TruthPoint]]:
    """The atlas beside the truth along the growth path and along each covariate; empty for real data."""
    module = _synthetic(atlas)
    if module is None:
        return [], []
    growth = [
        _compared(atlas, module, covariate, values, condition, resolution)
        for covariate, condition, values in module.growth_path()
    ]
    effects = [
        _compared(
            atlas, module, covariate.name, atlas.population.centre | {covariate.name: value}, "", resolution
        )
        for covariate in atlas.covariates
        for value in plausible_values(atlas.population, covariate)
    ]
    return growth, effects


def _compared(
    atlas: Atlas,
    module: ModuleType,
    covariate: str,
    values: dict[str, float],
    condition: str,
    resolution: int,
) -> TruthPoint:
    truth = _aligned(atlas, module.true_shape(values), module.true_landmarks(values))
    shape = atlas.shape(values, resolution=resolution, extrapolate=True)
    return TruthPoint(
        covariate=covariate,
        value=values[covariate],
        condition=condition,
        volume_cm3=shape.volume / 1000,
        truth_cm3=truth.volume / 1000,
        hd_x100=hausdorff_x100(truth, shape),
    )


def plausible_values(population: Population, covariate: Covariate) -> list[float]:
    """Values at which somebody in the training data is close with the others at the centre.

    Close means: at least :data:`NEIGHBOURS` training rows within :data:`NEIGHBOUR_DISTANCE` standard
    deviations over the continuous covariates. A child of a year with the mean weight of the
    cohort does not exist, and no data say what it would look like.
    """
    if covariate.kind == "binary":
        return [-1.0, 1.0]
    continuous = [i for i, other in enumerate(population.covariates) if other.kind == "continuous"]
    training = population.normalised()[~population.held_out][:, continuous]
    column = [population.covariates[i].name for i in continuous].index(covariate.name)
    plausible = []
    for value in np.linspace(*covariate.range, 8 * EFFECT_VALUES):
        place = np.zeros(len(continuous))
        place[column] = covariate.normalise(value)
        near = np.linalg.norm(training - place, axis=1) <= NEIGHBOUR_DISTANCE
        if near.sum() >= NEIGHBOURS:
            plausible.append(float(value))
    chosen = np.linspace(0, len(plausible) - 1, min(EFFECT_VALUES, len(plausible))).round().astype(int)
    return [plausible[i] for i in chosen]


def _population_shapes(atlas: Atlas, resolution: int) -> Iterator[trimesh.Trimesh]:
    """Every training covariate vector at z = 0, then each slider from end to end."""
    population = atlas.population
    for row in np.flatnonzero(~population.held_out):
        yield atlas.shape(population.row(int(row)), resolution=resolution)
    for covariate in atlas.covariates:
        for value in np.linspace(*covariate.range, 2 * EFFECT_VALUES):
            yield atlas.effect(covariate.name, float(value), resolution=resolution)


def _corner_shapes(atlas: Atlas, resolution: int) -> Iterator[trimesh.Trimesh]:
    """The corners of the box of ranges, where there are no data."""
    ranges = [covariate.range for covariate in atlas.covariates]
    for corner in np.stack(np.meshgrid(*ranges), axis=-1).reshape(-1, len(ranges)):
        yield atlas.shape(
            dict(zip(atlas.population.names, map(float, corner), strict=True)), resolution=resolution
        )


def folded_share(atlas: Atlas, resolution: int) -> float:
    """Share of points on shapes of the training population (with their codes) where p + d(p) folds."""
    checkpoint, population = atlas.checkpoint, atlas.population
    rows = np.flatnonzero(~population.held_out)
    rng, network = np.random.default_rng(0), checkpoint.network()
    counts = []
    for index in rng.permutation(len(rows))[:FOLDING_SHAPES]:
        values, latent = population.row(int(rows[index])), checkpoint.latents[index]
        vertices = atlas.shape(values, latent, resolution).vertices
        if not len(vertices):
            continue
        near = atlas.frame.to_model(vertices)[rng.integers(0, len(vertices), FOLDING_POINTS)]
        near += rng.normal(0, 0.01, near.shape)
        vector = torch.as_tensor(normalised_vector(atlas.covariates, values), dtype=torch.float32)
        counts.append(folded(network, near.astype(np.float32), vector, torch.as_tensor(latent)).mean())
    return float(np.mean(counts))


def _template_volume(atlas: Atlas, resolution: int) -> dict[str, float | None]:
    """Volume of the template and, for synthetic data, of the true shape at the population centre."""
    module = _synthetic(atlas)
    truth = None if module is None else module.true_shape(atlas.population.centre).volume / 1000
    return {"volume_cm3": atlas.template(resolution).volume / 1000, "truth_cm3": truth}


def _part(progress: Progress | None, start: float, stop: float) -> Progress | None:
    return None if progress is None else lambda share: progress(start + (stop - start) * share)


def _tell(progress: Progress | None, share: float) -> None:
    if progress is not None:
        progress(share)
