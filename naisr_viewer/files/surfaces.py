"""Surfaces to files, each in its format's unit, with a record of what it is beside it."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from naisr_model.covariates import Covariate
from naisr_model.errors import InputError
from naisr_model.exports import FORMATS, MeshFormat, format_named, mesh_bytes, require_format
from naisr_viewer import __version__
from naisr_viewer.panels.base import Numbers
from naisr_viewer.panels.kinds import kind_of, title_of
from naisr_viewer.panels.maps import numbers_of
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.patients import OpenScan
from naisr_viewer.state.requests import Origin, SurfaceRequest, SurfaceResult

if TYPE_CHECKING:
    import trimesh

    from naisr_model.shapes.curve import Curve


POINT_FORMATS = ("ply", "vtp")
"""Formats that hold a cloud of points, and numbers at the points."""

NUMBERED_FORMATS = (*POINT_FORMATS, "csv")
"""Formats that hold numbers at the points."""


def surface_files(
    path: Path,
    result: SurfaceResult,
    atlas: AtlasCard,
    patient: OpenScan | None = None,
    reference: OpenScan | None = None,
) -> Iterator[tuple[Path, bytes]]:
    """A surface and, beside it, a JSON record of what it shows, each with its place.

    Args:
        path: the mesh file; its ending is one of :data:`~naisr_model.exports.FORMATS`, or of
            :data:`~naisr_model.exports.CURVE_FORMATS` where the atlas is one of curves.
        result: the surface or curve, in millimetres or the unit of the atlas.
        atlas: where it came from.
        patient: whose it is; None for the population average.
        reference: the patient that a change is counted from.

    Raises:
        InputError: when there is no surface to write, or the ending will not do.
    """
    yield path, surface_bytes(path, result, atlas)
    record = description(result, atlas, path.name, patient, reference)
    yield record_of(path), (json.dumps(record, indent=2, ensure_ascii=False) + "\n").encode()


def surface_bytes(path: Path, result: SurfaceResult, atlas: AtlasCard) -> bytes:
    """A surface alone; otherwise as :func:`surface_files`."""
    if len(result.points_mm) == 0:
        raise InputError(f"{title_of(result.request.panel)} has no surface at these values; nothing to write")
    if atlas.is_flat:
        return _curve_bytes(path, result, atlas)
    return mesh_bytes(_triangles(result, _at_vertices(result, atlas)), _writable(path, result))


def _curve_bytes(path: Path, result: SurfaceResult, atlas: AtlasCard) -> bytes:
    """A curve as the drawing or the text that the ending of its file asks for; numbers are in the text."""
    from naisr_model.shapes.written import csv_bytes, svg_bytes

    ending, curve = require_format(path, dim=2), _curve(result)
    return (
        csv_bytes(curve, _at_vertices(result, atlas))
        if ending == "csv"
        else svg_bytes(curve, atlas.frame.unit)
    )


def _curve(result: SurfaceResult) -> Curve:
    from naisr_model.shapes.curve import Curve  # here, because it would slow down the start

    return Curve(result.points_mm.astype(np.float64), result.faces)


def _writable(path: Path, result: SurfaceResult) -> MeshFormat:
    """The format in which a surface can be written to a file of this ending.

    Raises:
        InputError: when it cannot.
    """
    ending = format_named(path)
    if ending is None:
        raise InputError(f"cannot write '{path.name}'; the ending must be one of {', '.join(FORMATS)}")
    if len(result.faces) == 0 and ending not in POINT_FORMATS:
        raise InputError(
            f"{path.name} would hold a cloud of points; export it as {' or '.join(POINT_FORMATS)}"
        )
    return ending


def record_of(path: Path) -> Path:
    """The record of a mesh file, and of no other: ``shape.stl`` has ``shape.stl.json``."""
    return path.with_name(f"{path.name}.json")


def description(
    result: SurfaceResult,
    atlas: AtlasCard,
    file_name: str,
    patient: OpenScan | None = None,
    reference: OpenScan | None = None,
) -> dict[str, Any]:
    """What a mesh file shows, as plain JSON."""
    request = result.request
    margin = None if _is_missed(patient) else result.extent_margin
    given, extent = dict(request.values), atlas.frame.extent
    is_glb = format_named(Path(file_name)) == "glb"
    shape, parts = (_curve, "segments") if atlas.is_flat else (_triangles, "triangles")
    is_scan = result.origin is Origin.MEASURED
    return {
        "file": file_name,
        "atlas": atlas.name,
        "atlas_file": atlas.path.name,
        "view": title_of(request.panel),
        "covariates": _covariate_records(atlas, given),
        "depends_on": sorted(given),
        "length_unit": "m" if is_glb else atlas.frame.unit,
        "up": "y" if is_glb or atlas.is_flat else "z",
        extent.key(): None if is_scan and not result.extent else round(result.extent, 4),
        f"{extent.key()}_is": OF_SCAN if is_scan else OF_SURFACE,
        extent.key("of", parts): round(extent.of(shape(result)), 4) if len(result.faces) else None,
        extent.key("95_percent_margin"): None if margin is None else round(margin, 4),
        "numbers": _numbers_record(result, atlas, Path(file_name)),
        "patient": None if patient is None else patient_record(patient),
        "before": _before_record(request, atlas, reference),
        "vertices": len(result.points_mm),
        parts: len(result.faces),
        "lattice_resolution": request.resolution,
        "program": f"naisr-viewer {__version__}",
    }


OF_SURFACE = "of the smooth shape through the vertices, as in the window"
OF_SCAN = "of the scan as it was read; the file holds it as it is shown, in the frame of the atlas"


def _numbers(request: SurfaceRequest, atlas: AtlasCard) -> Numbers:
    """What the numbers on a surface are: those of the map that was asked for, else of the kind of view."""
    return kind_of(request.panel).numbers(atlas) if request.map is None else numbers_of(atlas, request.map)


def _at_vertices(result: SurfaceResult, atlas: AtlasCard) -> dict[str, NDArray[np.float32]]:
    """What is known at the vertices, ``[n]``, by name with unit."""
    coloured = result.colouring
    return {} if coloured is None else {_numbers(result.request, atlas).name: coloured.values}


def _numbers_record(result: SurfaceResult, atlas: AtlasCard, file: Path) -> dict[str, Any] | None:
    """What the numbers at the vertices are, and whether the file holds them."""
    if result.colouring is None:
        return None
    return _numbers(result.request, atlas)._asdict() | {
        "in_file": file.suffix.lower()[1:] in NUMBERED_FORMATS
    }


def _before_record(
    request: SurfaceRequest, atlas: AtlasCard, reference: OpenScan | None
) -> dict[str, Any] | None:
    """What a change is counted from."""
    if request.before is None:
        return None
    record = {"covariates": _covariate_records(atlas, dict(request.before[1]))}
    return record | {"patient": None if reference is None else patient_record(reference)}


def _covariate_records(atlas: AtlasCard, given: Mapping[str, float]) -> dict[str, Any]:
    """Of all covariates; those that are not given are at the population mean."""
    return {
        each.name: _covariate_record(each, given.get(each.name, each.centre)) for each in atlas.covariates
    }


def _triangles(
    result: SurfaceResult, at_vertices: Mapping[str, NDArray[np.float32]] = MappingProxyType({})
) -> trimesh.Trimesh:
    import trimesh  # here, because it would slow down the start

    points = np.asarray(result.points_mm, dtype=np.float64)
    numbers = cast("dict[str, ArrayLike]", dict(at_vertices))
    return trimesh.Trimesh(
        points, result.faces, vertex_normals=result.normals, vertex_attributes=numbers, process=False
    )


def _is_missed(patient: OpenScan | None) -> bool:
    """Whether it is the shape of somebody whose fit is not valid: how sure it is, nobody knows."""
    return patient is not None and patient.fit is not None and not patient.fit.is_valid


def patient_record(patient: OpenScan) -> dict[str, Any]:
    """Who it is, and what of the covariates is known of them; the rest was inferred."""
    fit = patient.fit
    return {
        "scan": patient.reading.path.name,
        "known": dict(patient.known),
        "fitted": None if fit is None else dict(fit.values),
        "is_valid": None if fit is None else fit.is_valid,
        "residual_mm": None if fit is None else round(fit.residual_mm, 4),
        "lasting": None if fit is None or fit.lasting is None else round(fit.lasting, 4),
    }


def _covariate_record(covariate: Covariate, value: float) -> dict[str, Any]:
    record: dict[str, Any] = {"value": value, "unit": covariate.unit}
    if covariate.kind == "binary":
        record["reading"] = covariate.format(value)
    return record
