"""Files of named points: CSV ``name,x,y,z``, and the two formats of 3D Slicer, which state their space.

A file of Slicer without a statement is in RAS, as its first versions wrote them.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

from naisr_model.data.sheets import read_sheet, read_text, split_title
from naisr_model.errors import InputError
from naisr_model.numerals import decimal_marks, read_number

Space = Literal["LPS", "RAS"]

FARTHEST_MM = 1e5
"""No scanner is as large."""

_TITLES = {"name": ("name", "label", "landmark", "id"), "x": ("x",), "y": ("y",), "z": ("z",)}
_FCSV_SPACES = {"0": "RAS", "RAS": "RAS", "1": "LPS", "LPS": "LPS"}
_FCSV_COLUMNS = "id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID"


class NamedPoint(NamedTuple):
    """A landmark: where it stands in the file, its name, and its coordinates as texts or numbers."""

    place: str
    name: str
    coordinates: Sequence[Any]


def read_markups(path: Path, space: Space) -> dict[str, tuple[float, float, float]]:
    """Landmarks by name in millimetres; those of a file that states its space in ``space``.

    Raises:
        InputError: when the file cannot be read, a name or a place is there twice, or a coordinate is no
            number or farther than any scanner is wide.
    """
    ending = path.name.lower()
    try:
        if ending.endswith(".json"):
            stated, points = _markups_json(path)
        elif ending.endswith(".fcsv"):
            stated, points = _fiducials(path)
        else:
            stated, points = space, _table(path)
    except InputError as error:
        raise InputError(f"landmarks {path.name}: {error}") from error
    signs = (1.0, 1.0, 1.0) if stated == space else (-1.0, -1.0, 1.0)
    _require_each_once(path, [point.name for point in points])
    marks = decimal_marks(str(value) for point in points for value in point.coordinates)
    return _require_apart(path, {point.name: _coordinates(path, point, marks, signs) for point in points})


def _require_each_once(path: Path, names: Sequence[str]) -> None:
    if "" in names:
        raise InputError(f"landmarks {path.name} has one without a name; name it")
    counts = Counter(name.casefold() for name in names)
    if doubled := [name for name in names if counts[name.casefold()] > 1]:
        raise InputError(f"landmarks {path.name} has '{doubled[0]}' twice; name each differently")


def _coordinates(
    path: Path, point: NamedPoint, marks: Collection[str], signs: Sequence[float]
) -> tuple[float, float, float]:
    numbers = []
    for value, sign in zip(point.coordinates, signs, strict=True):
        try:
            numbers.append(sign * read_number(str(value), marks))
        except ValueError as error:
            raise InputError(
                f"landmarks {path.name} must have the columns name,x,y,z with numbers; "
                f"{point.place} has '{value}'{error}"
            ) from error
    x, y, z = numbers
    if max(abs(x), abs(y), abs(z)) > FARTHEST_MM:
        raise InputError(
            f"landmarks {path.name}: '{point.name}' is at {x:g}, {y:g}, {z:g}, beyond any scanner; correct it"
        )
    return x, y, z


def _require_apart(
    path: Path, landmarks: dict[str, tuple[float, float, float]]
) -> dict[str, tuple[float, float, float]]:
    seen: dict[tuple[float, float, float], str] = {}
    for name, point in landmarks.items():
        if (other := seen.setdefault(point, name)) != name:
            x, y, z = point
            both = f"'{other}' and '{name}' both at {x:g}, {y:g}, {z:g}"
            raise InputError(f"landmarks {path.name} has {both}; set them again")
    return landmarks


def _table(path: Path) -> list[NamedPoint]:
    sheet = read_sheet(path)
    titles = {split_title(title)[0].casefold(): title for title in sheet.titles}
    found = {key: next((titles[one] for one in ones if one in titles), None) for key, ones in _TITLES.items()}
    if missing := [key for key, title in found.items() if title is None]:
        raise InputError(f"must have the columns name,x,y,z with numbers; '{missing[0]}' is missing")
    columns = [sheet.column(title) for title in found.values() if title is not None]
    return [
        NamedPoint(f"row {line.number}", columns[0][i], [column[i] for column in columns[1:]])
        for i, line in enumerate(sheet.lines)
    ]


def _fiducials(path: Path) -> tuple[str, list[NamedPoint]]:
    """Slicer's ``.fcsv``: comments at the start give the space and the columns."""
    lines = read_text(path)[0].splitlines()
    comments = {
        match[1].casefold(): match[2].strip()
        for line in lines
        if (match := re.fullmatch(r"#\s*(CoordinateSystem|columns)\s*=(.*)", line.strip(), re.IGNORECASE))
    }
    stated = comments.get("coordinatesystem", "RAS").upper()
    if stated not in _FCSV_SPACES:
        raise InputError(f"its coordinates are in {stated}; save them in LPS or RAS")
    columns = [column.strip() for column in comments.get("columns", _FCSV_COLUMNS).split(",")]
    if not {"label", "x", "y", "z"} <= set(columns):
        raise InputError(f"its columns are {', '.join(columns)}; label, x, y and z are needed")
    points = []
    for number, line in enumerate(lines, start=1):
        cells = [cell.strip() for cell in line.split(",")]
        if line.startswith("#") or not any(cells):
            continue
        if len(cells) < 1 + max(columns.index(key) for key in ("label", "x", "y", "z")):
            raise InputError(f"row {number} has {len(cells)} cells only; save it again")
        cell = dict(zip(columns, cells, strict=False))
        points.append(NamedPoint(f"row {number}", cell["label"], [cell[axis] for axis in "xyz"]))
    return _FCSV_SPACES[stated], points


def _three(position: Sequence[Any]) -> list[Any]:
    x, y, z = position
    return [x, y, z]


def _markups_json(path: Path) -> tuple[str, list[NamedPoint]]:
    """Slicer's ``.mrk.json``; points that were announced and never set are left out."""
    try:
        record = json.loads(read_text(path)[0])
        (markup,) = (one for one in record["markups"] if one.get("controlPoints"))
        stated = str(markup.get("coordinateSystem", "RAS")).upper()
        unit = str(markup.get("coordinateUnits", "mm"))
        points = [
            NamedPoint(f"control point {number}", str(point["label"]).strip(), _three(point["position"]))
            for number, point in enumerate(markup["controlPoints"], start=1)
            if point.get("positionStatus", "defined") == "defined"
        ]
    except (AttributeError, KeyError, RecursionError, TypeError, ValueError) as error:
        raise InputError(
            "is no file of one list of points from 3D Slicer; save it as .mrk.json again"
        ) from error
    if stated not in ("LPS", "RAS"):
        raise InputError(f"its coordinates are in {stated}; save them in LPS or RAS")
    if unit.strip("[]") != "mm":
        raise InputError(f"its coordinates are in {unit}; save them in mm")
    return stated, points
