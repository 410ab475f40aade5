"""How well a shape is completed: a third of a held-out surface is cut away, the rest fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, asdict, dataclass
from pathlib import Path
from typing import Any

import igl
import numpy as np
import trimesh
from numpy.typing import NDArray

from naisr_model.atlas import Atlas
from naisr_model.errors import InputError
from naisr_model.evaluation.held_out import (
    HeldOut,
    held_out,
    held_out_rows,
    opened,
    require_shapes,
)
from naisr_model.evaluation.metrics import volume_difference_cm3
from naisr_model.evaluation.reports import markdown_table, mean_and_median, pair_cell
from naisr_model.progress import SILENT, Progress
from naisr_model.work.journal import Record

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


@dataclass(frozen=True)
class WholeShape:
    """A held-out shape that is cut in every way.

    Attributes:
        row: of the population.
        seed: of the random vertex that a hole is cut around.
    """

    row: int
    seed: int

    @property
    def key(self) -> str:
        """The row."""
        return f"row {self.row}"


@dataclass(frozen=True)
class Completion:
    """Cut a third of each held-out surface away and measure how well a fit of the rest completes it.

    Attributes:
        atlas: the .safetensors file.
        store: where its held-out shapes are; not needed for the synthetic populations, which are made
            again from their seed.
        limit: at most so many held-out shapes; 0 takes all.
    """

    atlas: Path
    _: KW_ONLY
    store: Path | None = None
    limit: int = 0

    def cases(self) -> list[WholeShape]:
        """The held-out shapes whose covariates are inside the observed ranges.

        Raises:
            InputError: when none is to be had.
        """
        atlas = opened(self.atlas)
        if atlas.frame.dim != 3:
            raise InputError("parts are cut from surfaces in space; this atlas holds curves in the plane")
        require_shapes(atlas, self.store, self.limit)
        rows = held_out_rows(atlas, self.limit)
        inside = [row for row in rows if atlas.population.contains(atlas.population.row(row))]
        if not inside:
            raise InputError("no shape inside the observed ranges was held out; prepare with --held-out 0.2")
        return [WholeShape(row, seed) for seed, row in enumerate(inside)]

    def measure(self, case: WholeShape, progress: Progress = SILENT) -> Record:
        """Each of :data:`CUTS` in each of :data:`WAYS`: a :class:`Completed`, or null without a surface.

        Raises:
            Cancelled: when nobody waits any more.
        """
        atlas = opened(self.atlas)
        shape = held_out(atlas, self.store, case.row)
        average = atlas.shape(shape.values, progress=progress.quiet)
        found = {}
        for cut, piece in progress.over(CUTS):
            missing = cut_away(shape.mesh_mm, cut, case.seed)
            results = _completed(atlas, shape, missing, average, piece)
            found[cut] = {way: result and asdict(result) for way, result in results.items()}
        return found

    def summarise(self, records: Sequence[Record]) -> Record:
        """The report.

        Returns:
            ``n`` shapes; under each cut and each of :data:`WAYS` the mean and the median of each column and
            the share ``held`` of true volumes inside their interval, over ``n`` fits with a surface;
            ``definitions``.
        """
        cuts = {
            cut: {way: _record([one[cut][way] for one in records if one[cut][way]]) for way in WAYS}
            for cut in CUTS
        }
        return {"n": len(records), **cuts, "definitions": list(DEFINITIONS)}

    def markdown(self, report: Mapping[str, Any]) -> str:
        """The report as a table with its definitions."""
        rows = []
        for cut, title in CUTS.items():
            for way, label in WAYS.items():
                record = report[cut][way]
                held = "–" if record["held"] is None else f"{100 * record['held']:.0f} %"
                rows.append([f"{title}, {label}", *(pair_cell(record[name]) for name in COLUMNS), held])
        table = markdown_table(["", *COLUMNS.values(), "volume inside its 95 % interval"], rows)
        notes = "\n".join(f"- {text}." for text in report["definitions"])
        return f"**A third cut away, {report['n']} held-out shapes, mean / median**\n\n{table}\n\n{notes}\n"


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
    progress: Progress,
) -> dict[str, Completed | None]:
    seen_mm = _part(shape.mesh_mm, ~missing)
    true_cm3 = shape.mesh_mm.volume / 1000
    results: dict[str, Completed | None] = {}
    for (way, known), piece in progress.over([("given", shape.values), ("inferred", {})]):
        fit = atlas.fit(seen_mm, known, progress=piece)
        low, high = fit.volume_interval_cm3
        held = bool(low <= true_cm3 <= high)
        results[way] = completed(shape.mesh_mm, missing, fit.individual.surface, held)
    return {**results, "average": completed(shape.mesh_mm, missing, average)}


def _part(mesh_mm: trimesh.Trimesh, faces: NDArray[np.bool_]) -> trimesh.Trimesh:
    part = trimesh.Trimesh(mesh_mm.vertices, mesh_mm.faces[faces], process=False)
    part.remove_unreferenced_vertices()
    return part


def completed(
    true_mm: trimesh.Trimesh,
    missing: NDArray[np.bool_],
    fitted_mm: trimesh.Trimesh,
    held: bool | None = None,
) -> Completed | None:
    """How far a surface is from the true one; nothing where it is empty.

    Args:
        true_mm: the true surface.
        missing: which of its faces were cut away.
        fitted_mm: the surface that is judged.
        held: whether the true volume is inside the interval of the fit.
    """
    if not len(fitted_mm.faces):
        return None
    away_mm, seen_mm = (_distances_mm(_part(true_mm, faces), fitted_mm) for faces in (missing, ~missing))
    return Completed(
        missing_mm=float(away_mm.mean()),
        missing_hd95_mm=float(np.percentile(away_mm, 95)),
        seen_mm=float(seen_mm.mean()),
        seen_hd95_mm=float(np.percentile(seen_mm, 95)),
        vd_cm3=volume_difference_cm3(true_mm, fitted_mm),
        held=held,
    )


def _distances_mm(true_mm: trimesh.Trimesh, fitted_mm: trimesh.Trimesh) -> NDArray[np.float64]:
    """From points of the true surface to the nearest point of the fitted one, ``[SAMPLES]``."""
    points = trimesh.sample.sample_surface(true_mm, SAMPLES, seed=0)[0]
    vertices, faces = np.asarray(fitted_mm.vertices), np.asarray(fitted_mm.faces, np.int64)
    return np.sqrt(np.asarray(igl.point_mesh_squared_distance(points, vertices, faces)[0]))


def _record(rows: Sequence[Record]) -> Record:
    held = [row["held"] for row in rows if row["held"] is not None]
    columns = {name: mean_and_median([row[name] for row in rows]) for name in COLUMNS}
    return {"n": len(rows), **columns, "held": float(np.mean(held)) if held else None}
