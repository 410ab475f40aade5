"""The files of a series of shapes: a surface each, a table of their volumes and a picture of them all."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import pyvista as pv

from naisr_model.atlas import Individual
from naisr_model.files import replacing
from naisr_model.progress import SILENT, Progress

PIXELS = 400
"""Sides of each shape's part of the picture."""


def write_series(
    out: Path | None,
    people: Sequence[Individual],
    *,
    progress: Progress = SILENT,
) -> list[dict[str, float | str]]:
    """Measure each shape and, with ``out``, write it with a table and a picture into that folder.

    Returns:
        A record for each: covariates in real units, volume and its 95 % interval in cm³, mesh name.

    Raises:
        Cancelled: when nobody waits any more.
    """
    records: list[dict[str, float | str]] = []
    for (number, person), _ in progress.over(list(enumerate(people, start=1))):
        low, high = person.volume_interval_cm3
        volumes = {"volume_cm3": person.volume_cm3, "volume_low_cm3": low, "volume_high_cm3": high}
        records.append({**person.covariates, **volumes, "mesh": f"shape{number:02d}.stl"})
        if out is not None:
            with replacing(out / f"shape{number:02d}.stl") as temporary:
                person.surface.export(temporary)
    if out is not None:
        _write_table(out / "volumes.csv", records)
        _write_picture(out / "shapes.png", people)
    return records


def _title(person: Individual) -> str:
    values = person.covariates
    words = [covariate.format(values[covariate.name]) for covariate in person.atlas.covariates]
    return f"{', '.join(words)}\n{person.volume_cm3:.1f} cm³"


def _write_table(path: Path, records: Sequence[dict[str, float | str]]) -> None:
    text = io.StringIO()
    table = csv.DictWriter(text, list(records[0]), lineterminator="\n")
    table.writeheader()
    rounded = (
        {key: round(value, 4) if isinstance(value, float) else value for key, value in record.items()}
        for record in records
    )
    table.writerows(rounded)
    with replacing(path) as temporary:
        temporary.write_text(text.getvalue(), encoding="utf-8")


def _write_picture(path: Path, people: Sequence[Individual]) -> None:
    """The shapes side by side, at one scale and seen from one side."""
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
    with replacing(path) as temporary:
        plotter.screenshot(temporary)
    plotter.close()
