"""Text files of points, in space or in the plane."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from naisr_model.data import sheets
from naisr_model.errors import InputError
from naisr_model.numerals import LARGEST, decimal_marks, read_number

POINT_ENDINGS = {".csv", ".txt", ".xyz"}
"""Usual endings of such files."""

NUMBERS = {2: "two", 3: "three"}


def read_points(path: str | Path, axes: Sequence[str] = ("x", "y", "z")) -> NDArray[np.float64]:
    """Read a text file of points: a column for each axis, or a header that names the axes among others.

    Any text that :mod:`naisr_model.data.sheets` reads; lines that begin with # are skipped.

    Args:
        path: of the file.
        axes: their names.

    Returns:
        Coordinates as in the file, ``[n, len(axes)]``.

    Raises:
        InputError: when the file is missing, is no such text or has a coordinate that is not finite.
    """
    path = Path(path)
    try:
        lines, _ = sheets.read_lines(path, comment="#")
    except InputError as error:
        raise InputError(f"{path.name} cannot be read as points: {error}") from error
    if not lines:
        raise InputError(f"{path.name} is empty; give a line {','.join(axes)} for each point")
    columns = _columns(path, lines[0].cells, axes)
    body = lines[1:] if columns else lines
    wide = columns or tuple(range(len(axes)))
    for line in body:
        if len(line.cells) <= max(wide):
            raise InputError(
                f"{path.name} row {line.number} is a line without {NUMBERS[len(axes)]} numbers; correct it"
            )
    cells = [[line.cells[column] for column in wide] for line in body]
    if not cells:
        raise InputError(f"{path.name} has a header and no points; export it again")
    return _coordinates(path, cells, [line.number for line in body])


def _coordinates(path: Path, cells: list[list[str]], numbers: list[int]) -> NDArray[np.float64]:
    """Numbers of any spelling; at once where they are spelled as usual, since clouds are long."""
    flat = [cell for row in cells for cell in row]
    if not any("," in cell or "_" in cell for cell in flat):
        with contextlib.suppress(ValueError):
            points = np.array(flat, dtype=np.str_).astype(np.float64).reshape(len(cells), -1)
            if (np.abs(points) <= LARGEST).all():
                return points
    marks = decimal_marks(flat)
    points = np.zeros((len(cells), len(cells[0])))
    for i, row in enumerate(cells):
        for j, cell in enumerate(row):
            try:
                points[i, j] = read_number(cell, marks)
            except ValueError as error:
                without = f"a line without {NUMBERS[len(row)]} numbers"
                raise InputError(f"{path.name} row {numbers[i]} is {without}: '{cell}'{error}") from error
    return points


def _columns(path: Path, first: Sequence[str], axes: Sequence[str]) -> tuple[int, ...]:
    """Where the axes stand if the first line is a header; empty if it is numbers."""
    if all(_is_number(part) for part in first[: len(axes)]):
        return ()
    names = [sheets.split_title(part)[0].lower() for part in first]
    if not set(axes) <= set(names):
        listed = f"{', '.join(axes[:-1])} and {axes[-1]}"
        raise InputError(f"{path.name} has no columns {listed} in '{','.join(first)[:60]}'; name them so")
    if doubled := [axis for axis in axes if names.count(axis) > 1]:
        raise InputError(f"{path.name} has the column '{doubled[0]}' twice; rename one")
    return tuple(names.index(axis) for axis in axes)


def _is_number(text: str) -> bool:
    try:
        read_number(text, ",.")
    except ValueError as error:
        return "may be" in str(error)
    return True
