"""Surfaces to files, each in its format's unit, with a record of what it is beside it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from naisr_model.covariates import Covariate
from naisr_model.errors import InputError
from naisr_model.exports import FORMATS, mesh_bytes
from naisr_model.files import replacing
from naisr_viewer import __version__
from naisr_viewer.panels.kinds import title_of
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.patients import OpenScan
from naisr_viewer.state.requests import SurfaceResult

if TYPE_CHECKING:
    import trimesh


def write_atomically(path: Path, write: Callable[[Path], object]) -> None:
    """Let ``write`` fill a temporary file in the folder of ``path``, then put it in place.

    Raises:
        InputError: when the folder cannot be written to.
    """
    try:
        with replacing(path) as temporary:
            write(temporary)
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror or error}; choose another folder") from error


def write_surface(
    path: Path, result: SurfaceResult, atlas: AtlasCard, patient: OpenScan | None = None
) -> tuple[Path, Path]:
    """Write a surface and, beside it, a JSON record of what it shows.

    Args:
        path: the mesh file; its ending is one of :data:`~naisr_model.exports.FORMATS`.
        result: the surface, in millimetres.
        atlas: where it came from.
        patient: whose it is; None for the population average.

    Returns:
        The mesh file and the record.

    Raises:
        InputError: when there is no surface to write, or the ending or folder will not do.
    """
    if len(result.faces) == 0:
        raise InputError(f"{title_of(result.request.panel)} has no surface at these values; nothing to write")
    ending = next((each for each in FORMATS if path.suffix.lower() == f".{each}"), None)
    if ending is None:
        raise InputError(f"cannot write '{path.name}'; the ending must be one of {', '.join(FORMATS)}")
    beside = record_of(path)
    content = mesh_bytes(_triangles(result), ending)
    write_atomically(path, lambda place: place.write_bytes(content))
    text = json.dumps(description(result, atlas, path.name, patient), indent=2, ensure_ascii=False) + "\n"
    write_atomically(beside, lambda place: place.write_text(text, encoding="utf-8"))
    return path, beside


def record_of(path: Path) -> Path:
    """The record of a mesh file, and of no other: ``shape.stl`` has ``shape.stl.json``."""
    return path.with_name(f"{path.name}.json")


def description(
    result: SurfaceResult, atlas: AtlasCard, file_name: str, patient: OpenScan | None = None
) -> dict[str, Any]:
    """What a mesh file shows, as plain JSON."""
    request, margin = result.request, result.volume_margin_cm3
    given = dict(request.values)
    return {
        "file": file_name,
        "atlas": atlas.name,
        "atlas_file": atlas.path.name,
        "view": title_of(request.panel),
        "covariates": {c.name: _covariate_record(c, given.get(c.name, c.centre)) for c in atlas.covariates},
        "depends_on": sorted(given),
        "length_unit": "m" if file_name.lower().endswith(".glb") else "mm",
        "up": "y" if file_name.lower().endswith(".glb") else "z",
        "volume_cm3": round(result.volume_cm3, 4),
        "volume_cm3_is": "of the smooth surface through the vertices, as in the window",
        "volume_of_triangles_cm3": round(_triangles(result).volume / 1000, 4),
        "volume_95_percent_margin_cm3": None if margin is None else round(margin, 4),
        "patient": None if patient is None else _patient_record(patient),
        "vertices": len(result.points_mm),
        "triangles": len(result.faces),
        "lattice_resolution": request.resolution,
        "program": f"naisr-viewer {__version__}",
    }


def _triangles(result: SurfaceResult) -> trimesh.Trimesh:
    import trimesh  # here, because it would slow down the start

    points = np.asarray(result.points_mm, dtype=np.float64)
    return trimesh.Trimesh(points, result.faces, vertex_normals=result.normals, process=False)


def _patient_record(patient: OpenScan) -> dict[str, Any]:
    """Who it is, and what of the covariates is known of them; the rest was inferred."""
    fit = patient.fit
    return {
        "scan": patient.reading.path.name,
        "known": dict(patient.known),
        "fitted": None if fit is None else dict(fit.values),
        "residual_mm": None if fit is None else round(fit.residual_mm, 4),
        "lasting": None if fit is None or fit.lasting is None else round(fit.lasting, 4),
    }


def _covariate_record(covariate: Covariate, value: float) -> dict[str, Any]:
    record: dict[str, Any] = {"value": value, "unit": covariate.unit}
    if covariate.kind == "binary":
        record["reading"] = covariate.format(value)
    return record
