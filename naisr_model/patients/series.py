"""The files of a series of shapes: a surface or a curve each, a table of their volumes, a picture of all."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv

from naisr_model.atlas import Individual
from naisr_model.errors import InputError
from naisr_model.files import write_all
from naisr_model.frames import SPACE, Extent
from naisr_model.progress import SILENT, Progress
from naisr_model.shapes.kinds import kind_of
from naisr_model.shapes.written import shape_bytes

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
        A record for each: covariates in real units, volume (of curves area) and its 95 % interval, file name.

    Raises:
        Cancelled: when nobody waits any more.
    """
    records: list[Record] = []
    for (number, person), _ in progress.over(list(enumerate(people, start=1))):
        form = _form_of(person)
        value, (low, high) = form.measured(person)
        extent = form.extent(person)
        extents = {extent.key(): value, extent.key("low"): low, extent.key("high"): high}
        records.append({**person.covariates, **extents, form.column: f"shape{number:02d}.{form.endings[0]}"})
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
    owned = [{**each, "scan": _named(patient)} for each in records]
    shapes = {
        (out / str(record[form.column])).with_suffix(f".{ending}"): form.content(person, ending)
        for person, record in zip(people, records, strict=True)
        for form in [_form_of(person)]
        for ending in form.endings
    }
    write_all(
        chain(shapes.items(), [(out / PICTURE, _picture(people)), (out / TABLE, _table(owned).encode())])
    )
    for old in set(_files(out)) - {*shapes, out / PICTURE, out / TABLE}:
        old.unlink()


def _files(out: Path) -> list[Path]:
    """What is there of a series, whoever's."""
    found = [path for ending in ("stl", "svg", "csv") for path in out.glob(f"shape[0-9][0-9]*.{ending}")]
    return [*sorted(found), *filter(Path.exists, (out / TABLE, out / PICTURE))]


@dataclass(frozen=True)
class _Form:
    """How shapes of one number of dimensions are written.

    Attributes:
        column: of their files in the table.
        endings: of those files, the first one being told.
        extent: what is enclosed, and its unit.
        measured: how much that is, and where it is with a probability of 95 %.
        content: of a file.
        draw: a shape into a picture.
        look: at the picture from where it is seen best.
    """

    column: str
    endings: tuple[str, ...]
    extent: Callable[[Individual], Extent]
    measured: Callable[[Individual], tuple[float, tuple[float, float]]]
    content: Callable[[Individual, str], bytes]
    draw: Callable[[pv.Plotter, Any], object]
    look: Callable[[pv.Plotter], object]


def _form_of(person: Individual) -> _Form:
    return _FORMS[kind_of(person.surface).dim]


def _draw_curve(plotter: pv.Plotter, curve: Any) -> None:
    for loop in curve.loops:
        points = np.pad(curve.vertices[[*loop, loop[0]]], ((0, 0), (0, 1)))
        plotter.add_lines(points, color="black", width=2, connected=True)


_FORMS = {
    2: _Form(
        "curve",
        ("svg", "csv"),
        lambda person: person.atlas.extent,
        lambda person: (person.extent, person.extent_interval),
        lambda person, ending: shape_bytes(person.surface, ending, person.atlas.frame.unit),
        _draw_curve,
        lambda plotter: plotter.view_xy(),
    ),
    3: _Form(
        "mesh",
        ("stl",),
        lambda person: SPACE,
        lambda person: (person.volume_cm3, person.volume_interval_cm3),
        lambda person, ending: shape_bytes(person.surface, ending),
        lambda plotter, mesh: plotter.add_mesh(pv.wrap(mesh), color="#d8c8b8", smooth_shading=True),
        lambda plotter: plotter.view_yz(),
    ),
}


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
    form = _form_of(person)
    return f"{', '.join(words)}\n{form.extent(person).told(form.measured(person)[0])}"


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
            _form_of(person).draw(plotter, person.surface)
        plotter.add_text(_title(person), font_size=8, color="black")
    plotter.background_color = "white"
    plotter.link_views()
    _form_of(people[0]).look(plotter)
    try:
        plotter.screenshot(picture)
    finally:
        plotter.close()
    return picture.getvalue()
