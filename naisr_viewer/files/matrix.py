"""The matrix as files: a figure, the mesh of each cell, and a record of it all, in a folder of their own."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

from naisr_model.files import write_all
from naisr_viewer.files.exports import Planned, matrix_stem, planned
from naisr_viewer.files.figure import MatrixFigure, Plate
from naisr_viewer.files.surfaces import description, surface_bytes
from naisr_viewer.panels.kinds import caption_of, title_of
from naisr_viewer.panels.matrix import is_pale
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.layouts import Panel
from naisr_viewer.state.matrix import Side, plain_panel
from naisr_viewer.state.requests import ExportChoice, SurfaceResult
from naisr_viewer.words.captions import lines_of
from naisr_viewer.words.matrix import heads, note
from naisr_viewer.words.titles import label


class MatrixPlan(NamedTuple):
    """What is written.

    Attributes:
        cells: the meshes.
        figure: the file of the figure; its ending says which kind.
        record: of all of it.
    """

    cells: tuple[Planned, ...]
    figure: Path
    record: Path

    @property
    def in_the_way(self) -> list[Path]:
        """Files that would be replaced."""
        files = [self.figure, *(each.path for each in self.cells), self.record]
        return [file for file in files if file.exists()]


def planned_matrix(state: ExplorerState, choice: ExportChoice) -> MatrixPlan:
    """What is written for ``choice``, which has a figure, at the values of ``state``."""
    stem = matrix_stem(state)
    folder = choice.folder / stem
    cells = planned(state, replace(choice, folder=folder))
    return MatrixPlan(tuple(cells), folder / f"{stem}.{choice.figure}", folder / f"{stem}.json")


def figure_of(
    state: ExplorerState,
    choice: ExportChoice,
    surfaces: Sequence[SurfaceResult],
    colours: Mapping[Panel, str],
) -> MatrixFigure:
    """What the figure shows of ``state``, with the surface of each cell and the colour of that."""
    assert state.atlas is not None
    assert state.matrix is not None
    plates = {
        panel.cell: Plate(surface, colours[panel], lines_of(caption_of(state, surface)))
        for surface in surfaces
        if (panel := surface.request.panel).cell is not None
    }
    across, down = label(state.matrix.across.covariate), label(state.matrix.down.covariate)
    unit, ends = state.atlas.frame.unit, heads(state.atlas, state.matrix)
    return MatrixFigure(across, down, ends, plates, note(state), choice.camera, unit)


def write_matrix(
    plan: MatrixPlan, state: ExplorerState, surfaces: Sequence[SurfaceResult], figure: bytes
) -> None:
    """Write all files of a plan, or none; surfaces are in its order, and a cell without one has no mesh.

    Raises:
        InputError: when one of them cannot be written.
    """
    assert state.atlas is not None
    cells = zip(plan.cells, surfaces, strict=True)
    there = [(each.path, surface) for each, surface in cells if has(surface)]
    meshes = ((path, surface_bytes(path, surface, state.atlas)) for path, surface in there)
    text = json.dumps(record(plan, state, surfaces), indent=2, ensure_ascii=False) + "\n"
    write_all(chain(meshes, [(plan.figure, figure), (plan.record, text.encode())]))


def record(plan: MatrixPlan, state: ExplorerState, surfaces: Sequence[SurfaceResult]) -> dict[str, Any]:
    """What the files show, as plain JSON."""
    assert state.matrix is not None
    cells = [_cell(each, state, surface) for each, surface in zip(plan.cells, surfaces, strict=True)]
    return {
        "figure": plan.figure.name,
        "across": _side(state.matrix.across),
        "down": _side(state.matrix.down),
        "cells": cells,
    }


def has(surface: SurfaceResult) -> bool:
    """Whether there is a surface at these values."""
    return len(surface.faces) > 0


def _side(side: Side) -> dict[str, Any]:
    return {"covariate": side.covariate, "values": list(side.values)}


def _cell(planned_one: Planned, state: ExplorerState, surface: SurfaceResult) -> dict[str, Any]:
    """Column and row are counted from the axes, which are 0."""
    assert state.atlas is not None
    panel = surface.request.panel
    column, row = panel.cell or (0, 0)
    told = description(surface, state.atlas, planned_one.path.name, planned_one.owner)
    view = title_of(plain_panel(surface.request.values))
    mesh = {"view": view, "file": planned_one.path.name if has(surface) else None}
    return {"column": column, "row": row, "outside_the_data": is_pale(state, panel)} | told | mesh
