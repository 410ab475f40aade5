"""The matrix: shapes at many values of two covariates at once, those of each covariate alone as its axes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from naisr_model.covariates import Covariate
from naisr_viewer.state.atlas_card import AtlasCard, RealVector
from naisr_viewer.state.layouts import FULL_SHAPE, TEMPLATE, Cell, Panel
from naisr_viewer.state.patients import Named

FIRST_COLUMNS, FIRST_ROWS = 4, 3
LEAST_STEPS = 2
MOST_COLUMNS, MOST_ROWS = 6, 5
"""How many values of a covariate there are, beside the axis."""

SHARE_BEYOND = 0.05
"""Of the people behind the atlas, as many are below the first value, and above the last."""

Axis = Literal["across", "down"]


@dataclass(frozen=True)
class Side:
    """What changes along one side of the matrix.

    Attributes:
        covariate: its name.
        values: real values, from low to high.
    """

    covariate: str
    values: RealVector


@dataclass(frozen=True)
class Matrix:
    """What shapes are laid out by.

    Attributes:
        across: what changes from column to column.
        down: what changes from row to row; another covariate.
    """

    across: Side
    down: Side


def first_matrix(atlas: AtlasCard) -> Matrix | None:
    """By the first two covariates, continuous ones before others; None where there are fewer."""
    names = [each.name for each in sorted(atlas.covariates, key=lambda each: each.kind == "binary")]
    if len(names) < 2:
        return None
    return Matrix(side_of(atlas, names[0], FIRST_COLUMNS), side_of(atlas, names[1], FIRST_ROWS))


def kept_matrix(atlas: AtlasCard, kept: Matrix | None) -> Matrix | None:
    """A matrix that was kept, where the atlas has what it is laid out by; otherwise its first one."""
    if kept is None or kept.across.covariate == kept.down.covariate:
        return first_matrix(atlas)
    fits = _fits(atlas, kept.across, MOST_COLUMNS) and _fits(atlas, kept.down, MOST_ROWS)
    return kept if fits else first_matrix(atlas)


def side_of(atlas: AtlasCard, name: str, count: int) -> Side:
    """A covariate at equal distances, as far as 90 % of the people go; a binary one at its two levels.

    Values are rounded as the number boxes show them, and inside the observed range.
    """
    covariate = atlas.covariates[atlas.index(name)]
    if covariate.kind == "binary":
        return Side(name, covariate.range)
    low, high = _most(atlas, covariate)
    rounded = (round(float(value), covariate.decimals) for value in np.linspace(low, high, count))
    return Side(name, tuple(min(max(value, covariate.range[0]), covariate.range[1]) for value in rounded))


def with_covariate(atlas: AtlasCard, matrix: Matrix, axis: Axis, name: str) -> Matrix:
    """Another covariate along an axis, at as many values; the two change places where it has the other."""
    old: Side = getattr(matrix, axis)
    if name in (matrix.across.covariate, matrix.down.covariate):
        return matrix if name == old.covariate else Matrix(matrix.down, matrix.across)
    first = FIRST_COLUMNS if axis == "across" else FIRST_ROWS
    count = len(old.values) if len(old.values) > LEAST_STEPS else first
    return _with(matrix, axis, side_of(atlas, name, count))


def with_count(atlas: AtlasCard, matrix: Matrix, axis: Axis, count: int) -> Matrix:
    """So many values of a continuous covariate along an axis."""
    old: Side = getattr(matrix, axis)
    return _with(matrix, axis, side_of(atlas, old.covariate, count))


def cells_of(matrix: Matrix) -> tuple[Cell, ...]:
    """Every cell, axes included, row by row."""
    columns, rows = len(matrix.across.values) + 1, len(matrix.down.values) + 1
    return tuple((column, row) for row in range(rows) for column in range(columns))


def is_inner(cell: Cell) -> bool:
    """Whether a cell is on neither axis."""
    return all(cell)


def own_values(matrix: Matrix, cell: Cell) -> dict[str, float]:
    """The covariates that a cell has by its column and row: one on an axis, none where the axes meet."""
    places = zip((matrix.across, matrix.down), cell, strict=True)
    return {side.covariate: side.values[place - 1] for side, place in places if place}


def values_at(atlas: AtlasCard, matrix: Matrix, cell: Cell, present: RealVector) -> RealVector:
    """All covariates of a cell: those beside its own are as at ``present``, on the axes at their centre."""
    own = own_values(matrix, cell)
    rest = present if is_inner(cell) else atlas.start
    return tuple(own.get(each.name, value) for each, value in zip(atlas.covariates, rest, strict=True))


def distance(atlas: AtlasCard, matrix: Matrix, cell: Cell, present: RealVector) -> float:
    """How far the covariates of a cell are from ``present``, each counted in its spread."""
    there = values_at(atlas, matrix, cell, present)
    scales = [each.scale for each in atlas.covariates]
    return float(np.linalg.norm(np.subtract(there, present) / scales))


def nearest(atlas: AtlasCard, matrix: Matrix, present: RealVector) -> Cell:
    """The cell whose covariates are nearest to ``present``."""
    return min(cells_of(matrix), key=lambda cell: distance(atlas, matrix, cell, present))


def plain_panel(values: Named) -> Panel:
    """What a cell of these values shows, as the other layouts call it.

    With one covariate moved it is that covariate's effect, with none the template.
    """
    if len(values) > 1:
        return FULL_SHAPE
    return Panel("effect", values[0][0]) if values else TEMPLATE


def _with(matrix: Matrix, axis: Axis, side: Side) -> Matrix:
    return replace(matrix, across=side) if axis == "across" else replace(matrix, down=side)


def _fits(atlas: AtlasCard, side: Side, most: int) -> bool:
    found = [each for each in atlas.covariates if each.name == side.covariate]
    return 0 < len(side.values) <= most and any(all(map(each.contains, side.values)) for each in found)


def _most(atlas: AtlasCard, covariate: Covariate) -> tuple[float, float]:
    """Where most people are; the observed range where nearly all have one value."""
    column = atlas.population.values[:, atlas.index(covariate.name)]
    low, high = np.quantile(column, (SHARE_BEYOND, 1 - SHARE_BEYOND))
    return (float(low), float(high)) if low < high else covariate.range
