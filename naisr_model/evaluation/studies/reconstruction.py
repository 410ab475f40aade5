"""Is an atlas true? Held-out shapes refitted, and where the population is synthetic, its effects checked."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
import trimesh
from numpy.typing import NDArray

from naisr_model.atlas import Atlas
from naisr_model.covariates import Covariate, Population, Values, normalised_vector
from naisr_model.data.align import rigid_transform
from naisr_model.data.populations import POPULATIONS, PopulationModule, PopulationVisit
from naisr_model.data.populations import population as population_module
from naisr_model.data.store import SampleStore
from naisr_model.errors import InputError
from naisr_model.evaluation.metrics import Distances, compare, component_count, hausdorff_x100
from naisr_model.evaluation.reports import TruthPoint, reconstruction_report
from naisr_model.learning.fitting.prior import prior_of
from naisr_model.learning.fitting.search import ShapeFit, fit_shape
from naisr_model.learning.fitting.target import target_of
from naisr_model.surface.folding import folded_shares

Progress = Callable[[float], None]
StopCheck = Callable[[], bool]

NEIGHBOURS, NEIGHBOUR_DISTANCE = 3, 0.25
EFFECT_VALUES = 9
FOLDING_SHAPES, FOLDING_RESOLUTION = 40, 64


@dataclass(frozen=True)
class EvaluationConfig:
    """What an evaluation costs.

    Attributes:
        resolution: of the surfaces that are measured.
        check_resolution: of the many surfaces whose components are counted.
        limit: at most so many held-out shapes; 0 takes all.
    """

    resolution: int = 192
    check_resolution: int = 96
    limit: int = 0


@dataclass(frozen=True, eq=False)
class HeldOut:
    """One shape that the training never saw, in the atlas frame.

    Attributes:
        values: covariates in real units.
        mesh_mm: the surface.
        subject: whose it is.
        visit: which of the subject's.
    """

    values: dict[str, float]
    mesh_mm: trimesh.Trimesh
    subject: str = ""
    visit: str = ""


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
    if not shapes:
        raise InputError("no shape was held out, so nothing can be evaluated; prepare with --held-out 0.2")
    latents = fit_all(atlas, shapes, _part(progress, 0.0, 0.2), should_stop)
    given = [(shape.values, latent) for shape, latent in zip(shapes, latents, strict=True)]
    inferred = infer_all(atlas, shapes, _part(progress, 0.2, 0.5), should_stop)
    found: list[Distances | None] = []
    components = []
    for done, ((values, latent), shape) in enumerate(zip(given + inferred, shapes * 2, strict=True), start=1):
        fitted = atlas.shape(values, latent, config.resolution, extrapolate=True, should_stop=should_stop)
        components.append(component_count(fitted))
        found.append(compare(shape.mesh_mm, fitted) if len(fitted.faces) else None)
        _tell(progress, 0.5 + 0.2 * done / (2 * len(shapes)))
    growth, effects, template = truth_points(
        atlas, config.resolution, _part(progress, 0.7, 0.85), should_stop
    )
    latest = _part(progress, 0.85, 1.0)
    plausible, corners = population_components(atlas, config.check_resolution, latest, should_stop)
    return reconstruction_report(
        _there(found[: len(shapes)]),
        inferred=_there(found[len(shapes) :]),
        components=components + plausible,
        folded_share=folded_share(atlas),
        growth=growth,
        effects=effects,
        template=template,
        corner_components=corners,
        mean_displacement_mm=mean_displacement_mm(atlas, shapes[0].mesh_mm),
        without_surface=found.count(None),
    )


def _there(found: Sequence[Distances | None]) -> list[Distances]:
    return [distances for distances in found if distances is not None]


def held_out_shapes(
    atlas: Atlas,
    store: SampleStore | None,
    limit: int | None = None,
    subjects: Collection[str] | None = None,
) -> list[HeldOut]:
    """The first held-out shapes of a store, or of the synthetic population that the atlas was made from.

    Args:
        atlas: what was trained.
        store: what it was trained on; None where the population can be made again.
        limit: at most so many shapes.
        subjects: whose shapes count; None for all.

    Raises:
        InputError: when the atlas was made from somebody's own data and no store, or another, is given.
    """
    people = atlas.population
    rows = [int(row) for row in np.flatnonzero(people.held_out)]
    rows = [row for row in rows if subjects is None or people.subjects[row] in subjects][:limit]
    if store is not None:
        _require_same_data(atlas, store)
        meshes = {
            (store.population.subjects[i], store.population.visits[i]): i
            for i in range(len(store.population))
        }
        places = [(people.subjects[row], people.visits[row]) for row in rows]
        return [
            HeldOut(people.row(row), store.mesh(meshes[place]), *place)
            for row, place in zip(rows, places, strict=True)
        ]
    module = synthetic(atlas)
    if module is None:
        raise InputError(
            "this atlas was made from data of your own; give the store it was trained on with --store"
        )
    visits = source_visits(atlas, module)
    return [
        HeldOut(dict(visit.values), aligned(atlas, *module.visit_shape(visit)), visit.subject, visit.visit)
        for visit in (visits[people.subjects[row], people.visits[row]] for row in rows)
    ]


def source_visits(atlas: Atlas, module: PopulationModule) -> dict[tuple[str, str], PopulationVisit]:
    """Everybody in the synthetic population that an atlas records as its source, by subject and visit."""
    source = atlas.checkpoint.source
    visits = module.visits(int(source["seed"]), int(source["patients"]))
    return {(visit.subject, visit.visit): visit for visit in visits}


def _require_same_data(atlas: Atlas, store: SampleStore) -> None:
    known, given = atlas.population, store.population
    same = {
        "covariates": known.covariates == given.covariates,
        "frame": atlas.frame == store.frame,
        "alignment": atlas.checkpoint.alignment == store.alignment,
        "held-out shapes": _held_out_visits(known) == _held_out_visits(given),
    }
    if other := [name for name, equal in same.items() if not equal]:
        raise InputError(
            f"{store.path} is not the store that this atlas was trained on: other {', '.join(other)}"
        )


def _held_out_visits(population: Population) -> list[tuple[str, str]]:
    rows = np.flatnonzero(population.held_out)
    return [(population.subjects[row], population.visits[row]) for row in rows]


def is_inside(population: Population, values: Values) -> bool:
    """Whether all covariates are inside their observed ranges, so that a fit takes them as known."""
    return all(c.range[0] <= values[c.name] <= c.range[1] for c in population.covariates)


def synthetic(atlas: Atlas) -> PopulationModule | None:
    """The population that an atlas records as its source and that can be made again."""
    source = atlas.checkpoint.source
    known = source.get("population") in POPULATIONS and {"seed", "patients"} <= set(source)
    return population_module(str(source["population"])) if known else None


def aligned(
    atlas: Atlas, mesh: trimesh.Trimesh, landmarks: dict[str, tuple[float, float, float]]
) -> trimesh.Trimesh:
    """A scan in millimetres and its landmarks, moved to the atlas frame as the training scans were."""
    moved = mesh.copy()
    moved.apply_transform(rigid_transform(atlas.checkpoint.alignment, mesh, landmarks))
    return moved


def fit_all(
    atlas: Atlas,
    shapes: Sequence[HeldOut],
    progress: Progress | None = None,
    should_stop: StopCheck | None = None,
) -> NDArray[np.float64]:
    """Codes of all shapes at their known covariates, ``[n, L]``."""
    known = [normalised_vector(atlas.covariates, shape.values) for shape in shapes]
    return np.stack([fit.latent for fit in _fits(atlas, shapes, known, progress, should_stop)])


def infer_all(
    atlas: Atlas,
    shapes: Sequence[HeldOut],
    progress: Progress | None = None,
    should_stop: StopCheck | None = None,
) -> list[tuple[dict[str, float], NDArray[np.float64]]]:
    """Covariates in real units and code of each shape, nothing being known of it."""
    unknown = [np.full(len(atlas.covariates), np.nan)] * len(shapes)
    return [
        ({c.name: float(c.restore(fit.covariates[i])) for i, c in enumerate(atlas.covariates)}, fit.latent)
        for fit in _fits(atlas, shapes, unknown, progress, should_stop)
    ]


def _fits(
    atlas: Atlas,
    shapes: Sequence[HeldOut],
    known: Sequence[NDArray[np.float64]],
    progress: Progress | None,
    should_stop: StopCheck | None,
) -> list[ShapeFit]:
    network = atlas.checkpoint.network().requires_grad_(False)
    prior, fits = prior_of(atlas.population, atlas.checkpoint.latents), []
    binary = [i for i, covariate in enumerate(atlas.covariates) if covariate.kind == "binary"]
    for done, (shape, vector) in enumerate(zip(shapes, known, strict=True), start=1):
        target = target_of(shape.mesh_mm, atlas.frame)
        fits.append(fit_shape(network, target, prior, vector, binary, should_stop=should_stop)[0])
        _tell(progress, done / len(shapes))
    return fits


def truth_points(
    atlas: Atlas,
    resolution: int,
    progress: Progress | None = None,
    should_stop: StopCheck | None = None,
) -> tuple[list[TruthPoint], list[TruthPoint], TruthPoint | None]:
    """The atlas beside the truth; nothing for real data.

    Returns:
        Places along the growth path, places along each covariate, and the template.
    """
    module = synthetic(atlas)
    if module is None:
        return [], [], None
    growth, centre = module.growth_path(), atlas.population.centre
    effects = [
        (covariate.name, "", centre | {covariate.name: value})
        for covariate in atlas.covariates
        for value in plausible_values(atlas.population, covariate)
    ]
    places = [*growth, *effects, (atlas.covariates[0].name, "template", centre)]
    points = []
    for done, place in enumerate(places, start=1):
        points.append(_compared(atlas, module, *place, resolution=resolution, should_stop=should_stop))
        _tell(progress, done / len(places))
    return points[: len(growth)], points[len(growth) : -1], points[-1]


def _compared(
    atlas: Atlas,
    module: PopulationModule,
    covariate: str,
    condition: str,
    values: dict[str, float],
    *,
    resolution: int,
    should_stop: StopCheck | None = None,
) -> TruthPoint:
    """Phi(c, z = 0), which is Phi_i where only covariate i is off its centre, beside the true shape."""
    truth = aligned(atlas, module.true_shape(values), module.true_landmarks(values))
    shape = atlas.shape(values, resolution=resolution, extrapolate=True, should_stop=should_stop)
    return TruthPoint(
        covariate=covariate,
        value=values[covariate],
        condition=condition,
        volume_cm3=shape.volume / 1000,
        truth_cm3=truth.volume / 1000,
        hd_x100=hausdorff_x100(truth, shape) if len(shape.faces) else float("inf"),
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


def population_components(
    atlas: Atlas,
    resolution: int,
    progress: Progress | None = None,
    should_stop: StopCheck | None = None,
) -> tuple[list[int], list[int]]:
    """Connected components of surfaces at z = 0.

    Returns:
        Those of every training covariate vector and of each slider from end to end, the others at
        their mean; and those of the corners of the box of ranges, where there are no data.
    """
    population, ranges = atlas.population, [covariate.range for covariate in atlas.covariates]
    training = [population.row(int(row)) for row in np.flatnonzero(~population.held_out)]
    sliders = [
        {covariate.name: float(value)}
        for covariate in atlas.covariates
        for value in np.linspace(*covariate.range, 2 * EFFECT_VALUES)
    ]
    corners = [
        dict(zip(population.names, map(float, corner), strict=True)) for corner in itertools.product(*ranges)
    ]
    counts, places = [], [*training, *sliders, *corners]
    for done, values in enumerate(places, start=1):
        surface = atlas.shape(values, resolution=resolution, extrapolate=True, should_stop=should_stop)
        counts.append(component_count(surface))
        _tell(progress, done / len(places))
    return counts[: -len(corners)], counts[-len(corners) :]


def folded_share(atlas: Atlas) -> float:
    """Mean share of folded points near the surfaces of training shapes with their codes, z = 0 included."""
    checkpoint = atlas.checkpoint
    vectors = checkpoint.population.normalised()[~checkpoint.population.held_out]
    some = np.random.default_rng(0).permutation(len(vectors))[:FOLDING_SHAPES]
    covariates = torch.as_tensor(np.concatenate([vectors[some]] * 2), dtype=torch.float32)
    latents = torch.as_tensor(checkpoint.latents[some])
    both = torch.cat([latents, torch.zeros_like(latents)])
    return float(np.nanmean(folded_shares(checkpoint.network(), covariates, both, FOLDING_RESOLUTION)))


def mean_displacement_mm(atlas: Atlas, surface_mm: trimesh.Trimesh) -> dict[str, float]:
    """Length of the population's mean displacement of each covariate at z = 0, averaged over a surface.

    The template stands where the mean shape stands only if nobody's displacement is everybody's.
    """
    network, frame = atlas.checkpoint.network(), atlas.frame
    points = frame.to_model(trimesh.sample.sample_surface(surface_mm, 500, seed=0)[0])
    vectors = atlas.population.normalised()[~atlas.population.held_out]
    total = torch.zeros(len(atlas.covariates), len(points), frame.dim)
    for vector in torch.as_tensor(vectors, dtype=torch.float32):
        with torch.inference_mode():
            total += network.displacements(
                torch.as_tensor(points, dtype=torch.float32)[None],
                vector[None],
                torch.zeros(1, network.config.latent),
            )[:, 0]
    lengths = (total / len(vectors)).norm(dim=-1).mean(dim=-1) * frame.scale_mm
    return dict(zip(atlas.population.names, map(float, lengths), strict=True))


def _part(progress: Progress | None, start: float, stop: float) -> Progress | None:
    return None if progress is None else lambda share: progress(start + (stop - start) * share)


def _tell(progress: Progress | None, share: float) -> None:
    if progress is not None:
        progress(share)
