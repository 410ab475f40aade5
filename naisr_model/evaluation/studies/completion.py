"""How well a shape is completed: a third of a held-out surface is cut away, the rest fitted."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import igl
import numpy as np
import trimesh
from numpy.typing import NDArray

from naisr_model.atlas import Atlas
from naisr_model.errors import InputError
from naisr_model.evaluation.metrics import volume_difference_cm3
from naisr_model.evaluation.reports import markdown_table, mean_and_median, pair_cell
from naisr_model.evaluation.studies.reconstruction import HeldOut, is_inside

Progress = Callable[[float], None]
StopCheck = Callable[[], bool]

SHARE = 1 / 3
"""Of the area, cut away."""

SAMPLES = 10_000
"""Points on each part, for the distances."""

CUTS = {"below": "from below", "above": "from above", "hole": "a hole"}
WAYS = {
    "given": "covariates given",
    "inferred": "covariates inferred",
    "average": "no fit: the population's average",
}
COLUMNS = {
    "missing_mm": "missing part: mean distance, mm",
    "missing_hd95_mm": "HD95, mm",
    "seen_mm": "seen part: mean distance, mm",
    "seen_hd95_mm": "HD95, mm",
    "vd_cm3": "VD, cm³",
}
DEFINITIONS = (
    f"a third of the area is cut away: the lowest, the highest, or what is nearest to a random vertex; "
    f"distances go from {SAMPLES:,} points of the missing and of the seen part of the true surface to the "
    "fitted one: their mean and their 95th percentile",
    "VD: absolute difference of the whole volumes",
    "the population's average is that at the true covariates, z = 0, and knows nothing of the seen part",
)


@dataclass(frozen=True)
class Completed:
    """How far a completed surface is from the true one, see :data:`COLUMNS`.

    Attributes:
        missing_mm: mean distance of the part that was cut away.
        missing_hd95_mm: 95th percentile of the same.
        seen_mm: mean distance of the part that was fitted.
        seen_hd95_mm: 95th percentile of the same.
        vd_cm3: absolute difference of the volumes.
        held: whether the true volume is inside the fit's 95 % interval; None without a fit.
    """

    missing_mm: float
    missing_hd95_mm: float
    seen_mm: float
    seen_hd95_mm: float
    vd_cm3: float
    held: bool | None


def completion(
    atlas: Atlas,
    shapes: Sequence[HeldOut],
    *,
    progress: Progress | None = None,
    should_stop: StopCheck | None = None,
) -> dict[str, Any]:
    """Cut each shape in every way of :data:`CUTS`, fit what is left and measure both parts.

    Args:
        atlas: what is fitted.
        shapes: held-out shapes; those with covariates outside the observed ranges are left out.
        progress: told the finished share.
        should_stop: polled between steps.

    Returns:
        ``n`` shapes; under each cut and each of :data:`WAYS` the mean and the median of each column and the
        share ``held`` of true volumes inside their interval, over ``n`` fits with a surface; ``definitions``.

    Raises:
        InputError: when no shape is left.
        Cancelled: when ``should_stop()`` turned true.
    """
    inside = [shape for shape in shapes if is_inside(atlas.population, shape.values)]
    if not inside:
        raise InputError("no shape inside the observed ranges was held out; prepare with --held-out 0.2")
    found: dict[str, dict[str, list[Completed]]] = {cut: {way: [] for way in WAYS} for cut in CUTS}
    for number, shape in enumerate(inside):
        average = atlas.shape(shape.values, should_stop=should_stop)
        for done, cut in enumerate(CUTS, start=1):
            missing = cut_away(shape.mesh_mm, cut, seed=number)
            for way, result in _completed(atlas, shape, missing, average, should_stop).items():
                found[cut][way] += [result] if result else []
            if progress is not None:
                progress((number + done / len(CUTS)) / len(inside))
    records = {cut: {way: _record(results) for way, results in ways.items()} for cut, ways in found.items()}
    return {"n": len(inside), **records, "definitions": list(DEFINITIONS)}


def cut_away(mesh_mm: trimesh.Trimesh, cut: str, seed: int = 0) -> NDArray[np.bool_]:
    """Which faces go: a third of the area, one of :data:`CUTS`.

    Args:
        mesh_mm: a whole surface with z to the head.
        cut: ``below`` and ``above`` take the lowest and the highest faces, ``hole`` those nearest to a
            random vertex.
        seed: of that vertex.
    """
    centres = np.asarray(mesh_mm.triangles_center)
    vertex = mesh_mm.vertices[np.random.default_rng(seed).integers(len(mesh_mm.vertices))]
    first = {
        "below": centres[:, 2],
        "above": -centres[:, 2],
        "hole": np.linalg.norm(centres - vertex, axis=1),
    }
    order = np.argsort(first[cut], kind="stable")
    away = np.cumsum(mesh_mm.area_faces[order]) <= SHARE * mesh_mm.area
    missing = np.zeros(len(order), dtype=bool)
    missing[order[away]] = True
    return missing


def _completed(
    atlas: Atlas,
    shape: HeldOut,
    missing: NDArray[np.bool_],
    average: trimesh.Trimesh,
    should_stop: StopCheck | None,
) -> dict[str, Completed | None]:
    seen_mm = _part(shape.mesh_mm, ~missing)
    true_cm3 = shape.mesh_mm.volume / 1000
    results: dict[str, Completed | None] = {}
    for way, known in (("given", shape.values), ("inferred", {})):
        fit = atlas.fit(seen_mm, known, should_stop=should_stop)
        low, high = fit.volume_interval_cm3
        results[way] = _measured(shape, missing, fit.individual.surface, bool(low <= true_cm3 <= high))
    return {**results, "average": _measured(shape, missing, average, None)}


def _part(mesh_mm: trimesh.Trimesh, faces: NDArray[np.bool_]) -> trimesh.Trimesh:
    part = trimesh.Trimesh(mesh_mm.vertices, mesh_mm.faces[faces], process=False)
    part.remove_unreferenced_vertices()
    return part


def _measured(
    shape: HeldOut, missing: NDArray[np.bool_], fitted_mm: trimesh.Trimesh, held: bool | None
) -> Completed | None:
    """Nothing where the fit has no surface."""
    if not len(fitted_mm.faces):
        return None
    away_mm, seen_mm = (
        _distances_mm(_part(shape.mesh_mm, faces), fitted_mm) for faces in (missing, ~missing)
    )
    return Completed(
        missing_mm=float(away_mm.mean()),
        missing_hd95_mm=float(np.percentile(away_mm, 95)),
        seen_mm=float(seen_mm.mean()),
        seen_hd95_mm=float(np.percentile(seen_mm, 95)),
        vd_cm3=volume_difference_cm3(shape.mesh_mm, fitted_mm),
        held=held,
    )


def _distances_mm(true_mm: trimesh.Trimesh, fitted_mm: trimesh.Trimesh) -> NDArray[np.float64]:
    """From points of the true surface to the nearest point of the fitted one, ``[SAMPLES]``."""
    points = trimesh.sample.sample_surface(true_mm, SAMPLES, seed=0)[0]
    vertices, faces = np.asarray(fitted_mm.vertices), np.asarray(fitted_mm.faces, np.int64)
    return np.sqrt(np.asarray(igl.point_mesh_squared_distance(points, vertices, faces)[0]))


def _record(results: Sequence[Completed]) -> dict[str, Any]:
    rows = [asdict(result) for result in results]
    held = [row["held"] for row in rows if row["held"] is not None]
    columns = {name: mean_and_median([row[name] for row in rows]) for name in COLUMNS}
    return {"n": len(rows), **columns, "held": float(np.mean(held)) if held else None}


def completion_markdown(report: Mapping[str, Any]) -> str:
    """The report of :func:`completion` as a table with its definitions."""
    rows = []
    for cut, title in CUTS.items():
        for way, label in WAYS.items():
            record = report[cut][way]
            held = "–" if record["held"] is None else f"{record['held']:.0%}"
            rows.append([f"{title}, {label}", *(pair_cell(record[name]) for name in COLUMNS), held])
    table = markdown_table(["", *COLUMNS.values(), "volume inside its 95 % interval"], rows)
    notes = "\n".join(f"- {text}." for text in report["definitions"])
    return f"**A third cut away, {report['n']} held-out shapes, mean / median**\n\n{table}\n\n{notes}\n"
