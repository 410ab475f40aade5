"""The files of a series of shapes: a surface each, a table of their volumes and a picture of them all."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from itertools import chain
from pathlib import Path

import pyvista as pv

from naisr_model.atlas import Individual
from naisr_model.errors import InputError
from naisr_model.exports import mesh_bytes
from naisr_model.files import write_all
from naisr_model.progress import SILENT, Progress

TABLE, PICTURE = "volumes.csv", "shapes.png"

PIXELS = 400
"""Sides of each shape's part of the picture."""

Record = dict[str, float | str]
"""What is known of a shape, by name with unit."""


def require_own(out: Path, patient: Path | None) -> None:
    """Make sure that a folder holds no series of anybody else.

    Args:
        out: the folder; it may be missing.
        patient: the file whose series is to be there; None for no patient's.

    Raises:
        InputError: when it holds files of another patient or of something else, or is a file.
    """
    if out.exists() and not out.is_dir():
        raise InputError(f"'{out}' is a file; give the name of a folder to write into")
    if there := _files(out):
        owner = _owner(out / TABLE)
        if owner != _named(patient):
            whose = owner or "something else"
            raise InputError(f"{out} holds {there[0].name} of {whose}; give another folder")


def series_records(people: Sequence[Individual], progress: Progress = SILENT) -> list[Record]:
    """Measure each of the shapes.

    Returns:
        A record for each: covariates in real units, volume and its 95 % interval in cm³, mesh name.

    Raises:
        Cancelled: when nobody waits any more.
    """
    records: list[Record] = []
    for (number, person), _ in progress.over(list(enumerate(people, start=1))):
        low, high = person.volume_interval_cm3
        volumes = {"volume_cm3": person.volume_cm3, "volume_low_cm3": low, "volume_high_cm3": high}
        records.append({**person.covariates, **volumes, "mesh": f"shape{number:02d}.stl"})
    return records


def write_series(
    out: Path, people: Sequence[Individual], records: Sequence[Record], patient: Path | None = None
) -> None:
    """Write each shape, a table and a picture into a folder: all of it, or nothing.

    What an earlier series of the same patient left there is removed then: the files belong together.

    Args:
        out: the folder.
        people: the shapes.
        records: of :func:`series_records`.
        patient: the file that they were made from.

    Raises:
        InputError: when the folder holds something else, see :func:`require_own`, or cannot be written.
    """
    require_own(out, patient)
    meshes = [out / str(record["mesh"]) for record in records]
    owned = [{**each, "scan": _named(patient)} for each in records]
    surfaces = zip(meshes, (mesh_bytes(person.surface, "stl") for person in people), strict=True)
    write_all(chain(surfaces, [(out / PICTURE, _picture(people)), (out / TABLE, _table(owned).encode())]))
    for old in set(_files(out)) - {*meshes, out / PICTURE, out / TABLE}:
        old.unlink()


def _files(out: Path) -> list[Path]:
    """What is there of a series, whoever's."""
    return [*sorted(out.glob("shape[0-9][0-9]*.stl")), *filter(Path.exists, (out / TABLE, out / PICTURE))]


def _named(patient: Path | None) -> str:
    return "" if patient is None else str(patient.resolve())


def _owner(table: Path) -> str | None:
    """Whose a series is; None of a table that is none of ours."""
    try:
        with table.open(newline="", encoding="utf-8") as file:
            return next(csv.DictReader(file), {}).get("scan")
    except (OSError, ValueError, csv.Error):
        return None


def _title(person: Individual) -> str:
    values = person.covariates
    words = [covariate.format(values[covariate.name]) for covariate in person.atlas.covariates]
    return f"{', '.join(words)}\n{person.volume_cm3:.1f} cm³"


def _table(records: Sequence[Record]) -> str:
    text = io.StringIO()
    table = csv.DictWriter(text, list(records[0]), lineterminator="\n")
    table.writeheader()
    rounded = (
        {key: round(value, 4) if isinstance(value, float) else value for key, value in record.items()}
        for record in records
    )
    table.writerows(rounded)
    return text.getvalue()


def _picture(people: Sequence[Individual]) -> bytes:
    """The shapes side by side, at one scale and seen from one side, as PNG."""
    picture = io.BytesIO()
    with pv.vtk_verbosity("error"):  # without a display VTK warns of it, then draws all the same
        plotter = pv.Plotter(
            off_screen=True, shape=(1, len(people)), window_size=(PIXELS * len(people), PIXELS)
        )
    for column, person in enumerate(people):
        plotter.subplot(0, column)
        if len(person.surface.faces):
            plotter.add_mesh(pv.wrap(person.surface), color="#d8c8b8", smooth_shading=True)
        plotter.add_text(_title(person), font_size=8, color="black")
    plotter.background_color = "white"
    plotter.link_views()
    plotter.view_yz()
    try:
        plotter.screenshot(picture)
    finally:
        plotter.close()
    return picture.getvalue()
