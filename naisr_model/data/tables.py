"""The user's table: one row a mesh, with the subject, the visit and the covariates.

Columns: ``mesh`` (path, relative to the table), ``subject``, optionally ``visit`` (numbered when
absent) and ``landmarks`` (path of a CSV ``name,x,y,z``); every other column is a covariate. A header
may carry a unit: ``age [months]`` or ``weight (kg)``. A TOML file with the same stem may add to it::

    name = "airway"
    [covariates.sex]
    kind = "binary"
    levels = ["F", "M"]
    [alignment]
    method = "landmarks"
    origin = "true vocal cords"
"""

from __future__ import annotations

import csv
import io
import math
import re
import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from naisr_model.covariates import Covariate, Kind, Population
from naisr_model.data.align import METHODS, Alignment
from naisr_model.errors import InputError
from naisr_model.files import replacing

RESERVED = ("mesh", "subject", "visit", "landmarks")
_TABLES = ("covariates", "alignment", "source")
_ALIGNMENT_KEYS = ("method", "origin")
_HEADER = re.compile(r"^(?P<name>.*?)\s*(?:\[(?P<square>[^\]]*)\]|\((?P<round>[^)]*)\))?\s*$")


@dataclass(frozen=True)
class TableRow:
    """One line of the table.

    Attributes:
        number: line in the file as a spreadsheet shows it; the header is 1.
        mesh: path of the mesh; empty path where the table has no such column.
        subject: who it is.
        visit: which of the subject's visits.
        landmarks: path of the landmarks, or None.
    """

    number: int
    mesh: Path
    subject: str
    visit: str
    landmarks: Path | None


@dataclass(frozen=True, eq=False)
class ShapeTable:
    """A table that was read and checked.

    Attributes:
        name: of the population; the file's stem unless the TOML says otherwise.
        rows: one a mesh.
        covariates: centre and scale are still 0 and 1; :func:`population_from_table` sets them.
        values: real units, -1/+1 for binary covariates, ``[n, len(covariates)]``.
        alignment: method and origin; the reference is made later.
        source: the TOML's ``[source]`` table.
    """

    name: str
    rows: tuple[TableRow, ...]
    covariates: tuple[Covariate, ...]
    values: NDArray[np.float64]
    alignment: Alignment
    source: dict[str, Any]

    def take(self, indices: Sequence[int]) -> ShapeTable:
        """The table with only some of its rows."""
        rows = tuple(self.rows[i] for i in indices)
        return replace(self, rows=rows, values=self.values[list(indices)])


def read_table(path: str | Path) -> ShapeTable:
    """Read ``path`` and the TOML beside it.

    The kind of a covariate is guessed where the TOML does not give it: two distinct values make it
    binary, the first in sorted order being -1. Where there is a ``landmarks`` column, alignment by
    landmarks is the default.

    Raises:
        InputError: naming the row and the column, for anything that cannot be used.
    """
    path = Path(path)
    header, lines = _read_lines(path)
    extra = _read_toml(path.with_suffix(".toml"))
    rows = _rows(path, header, lines)
    names = [name for name in header if name not in RESERVED]
    if not names:
        raise InputError(f"{path.name} has no covariate; add a column such as 'age [months]'")
    _known_only(path, extra, names)
    numbers = [row.number for row in rows]
    columns = [
        _column(path, name, header[name], extra.get("covariates", {}).get(name, {}), numbers, lines)
        for name in names
    ]
    return ShapeTable(
        name=extra.get("name", path.stem),
        rows=rows,
        covariates=tuple(covariate for covariate, _ in columns),
        values=np.stack([values for _, values in columns], axis=1),
        alignment=_alignment(path, extra.get("alignment", {}), "landmarks" in header),
        source=dict(extra.get("source", {})),
    )


def _read_lines(path: Path) -> tuple[dict[str, str], list[dict[str, str]]]:
    """Units by column name, and one dictionary of cells a line; the key ``""`` holds the line number."""
    if not path.is_file():
        raise InputError(f"the table {path} does not exist; correct the path")
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file)
            titles = [_split_title(title) for title in next(reader, [])]
            cells = [(reader.line_num, line) for line in reader if any(cell.strip() for cell in line)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path.name} cannot be read as a CSV table in UTF-8 ({error})") from error
    if doubled := [name for name, count in Counter(name for name, _ in titles).items() if count > 1]:
        raise InputError(f"{path.name} has the column '{doubled[0]}' twice; rename one")
    names = [name for name, _ in titles]
    if "" in names:
        raise InputError(f"{path.name} has a column without a name; name it or remove it")
    if "subject" not in names:
        raise InputError(f"{path.name} has no column 'subject'; it has {', '.join(names) or 'none'}")
    if not cells:
        raise InputError(f"{path.name} has a header but no rows; add one row a mesh")
    for number, line in cells:
        if len(line) != len(names):
            raise InputError(f"{path.name} row {number} has {len(line)} cells, the header has {len(names)}")
    lines = [dict(zip(names, map(str.strip, line), strict=True)) | {"": str(n)} for n, line in cells]
    return dict(titles), lines


def _split_title(title: str) -> tuple[str, str]:
    """``age [months]`` to ``("age", "months")``."""
    match = _HEADER.match(title.strip())
    if match is None:
        return title.strip(), ""
    return match["name"], (match["square"] or match["round"] or "").strip()


def _read_toml(path: Path) -> dict[str, Any]:
    if not path.is_file():
        return {}
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path.name} is not valid TOML ({error})") from error


def _known_only(path: Path, extra: Mapping[str, Any], names: Sequence[str]) -> None:
    toml = f"{path.stem}.toml"
    if unknown := sorted(set(extra) - {"name", *_TABLES}):
        raise InputError(f"{toml} has '{unknown[0]}'; it may have name, {', '.join(_TABLES)}")
    for key in _TABLES:
        if not isinstance(extra.get(key, {}), dict):
            raise InputError(f"'{key}' in {toml} must be a table, such as [{key}]")
    alignment = extra.get("alignment", {})
    if unknown := sorted(set(alignment) - set(_ALIGNMENT_KEYS)):
        raise InputError(f"[alignment] in {toml} has '{unknown[0]}'; it may have method and origin")
    _texts_only(toml, {"name": extra.get("name", "")} | alignment)
    for name, settings in extra.get("covariates", {}).items():
        if name not in names:
            raise InputError(f"{toml} describes '{name}', which is not a column of {path.name}")
        if not isinstance(settings, dict) or set(settings) - {"unit", "kind", "levels"}:
            raise InputError(f"[covariates.{name}] in {toml} may have unit, kind and levels only")
        _texts_only(toml, {key: value for key, value in settings.items() if key != "levels"})
        _check_levels(toml, name, settings.get("levels", []))
    for key, value in extra.get("source", {}).items():
        if not isinstance(value, str | int | float):  # it is kept as JSON, which has no dates
            raise InputError(f"'{key}' of [source] in {toml} is {value}; give text or a number")


def _texts_only(toml: str, settings: Mapping[str, Any]) -> None:
    for key, value in settings.items():
        if not isinstance(value, str):
            raise InputError(f"'{key}' in {toml} is {value}; put text in quotes")


def _check_levels(toml: str, name: str, levels: Any) -> None:
    if not isinstance(levels, list) or not all(isinstance(level, str | int | float) for level in levels):
        raise InputError(
            f'the levels of \'{name}\' in {toml} are {levels!r}; give a list of two, such as ["F", "M"]'
        )


def _rows(path: Path, header: Mapping[str, str], lines: Sequence[Mapping[str, str]]) -> tuple[TableRow, ...]:
    seen: Counter[str] = Counter()
    rows: list[TableRow] = []
    for line in lines:
        for name in RESERVED:
            if name in header and not line[name] and name != "landmarks":
                raise InputError(f"{path.name} row {line['']}, column '{name}' is empty; fill it in")
        subject = line["subject"]
        seen[subject] += 1
        rows.append(
            TableRow(
                number=int(line[""]),
                mesh=path.parent / line.get("mesh", ""),
                subject=subject,
                visit=line.get("visit", str(seen[subject])),
                landmarks=path.parent / line["landmarks"] if line.get("landmarks") else None,
            )
        )
    first: dict[tuple[str, str], int] = {}
    for row in rows:
        if (earlier := first.setdefault((row.subject, row.visit), row.number)) != row.number:
            raise InputError(
                f"{path.name} rows {earlier} and {row.number} are both visit '{row.visit}' of subject "
                f"'{row.subject}'; give each visit its own name"
            )
    return tuple(rows)


def _column(
    path: Path,
    name: str,
    header_unit: str,
    settings: Mapping[str, Any],
    numbers: Sequence[int],
    lines: Sequence[Mapping[str, str]],
) -> tuple[Covariate, NDArray[np.float64]]:
    """Read one covariate; centre and scale are set later, from the training rows."""
    cells = [line[name] for line in lines]
    for number, cell in zip(numbers, cells, strict=True):
        if not cell:
            raise InputError(
                f"{path.name} row {number}, column '{name}' is empty; fill it in or drop the row"
            )
    unit = _unit(path, name, header_unit, settings)
    levels = _levels(path, name, settings, cells)
    if levels is None:
        values = np.array([_number(path, number, name, c) for number, c in zip(numbers, cells, strict=True)])
    else:
        values = np.array([_level(path, n, name, c, levels) for n, c in zip(numbers, cells, strict=True)])
    kind: Kind = "continuous" if levels is None else "binary"
    observed = (float(values.min()), float(values.max()))
    if observed[0] == observed[1]:
        raise InputError(f"column '{name}' of {path.name} is {cells[0]} in every row; remove the column")
    return Covariate(name, unit, kind, 0.0, 1.0, observed, levels or ("-1", "+1")), values


def _unit(path: Path, name: str, header_unit: str, settings: Mapping[str, Any]) -> str:
    unit: str = settings.get("unit", header_unit)
    if header_unit and unit != header_unit:
        raise InputError(
            f"'{name}' is in {header_unit} by the header of {path.name} but in {unit} by {path.stem}.toml; "
            f"make them agree"
        )
    return unit


def _levels(
    path: Path, name: str, settings: Mapping[str, Any], cells: Sequence[str]
) -> tuple[str, str] | None:
    """The names of -1 and +1, or None for a continuous covariate."""
    distinct = sorted(set(cells), key=lambda cell: (_as_number(cell), cell))
    numeric = [cell for cell in distinct if not math.isnan(_as_number(cell))]
    kind = settings.get("kind", "binary" if "levels" in settings else _guess(distinct, numeric))
    if kind == "continuous":
        return None
    if kind != "binary":
        raise InputError(f"'{name}' has the kind '{kind}' in {path.stem}.toml; use continuous or binary")
    levels = tuple(map(str, settings.get("levels", distinct)))
    if len(levels) != 2 or len(set(levels)) != 2:
        shown = ", ".join(levels[:4]) + (", ..." if len(levels) > 4 else "")
        raise InputError(f"binary covariate '{name}' must have two values; it has {len(levels)}: {shown}")
    return levels[0], levels[1]


def _guess(distinct: Sequence[str], numeric: Sequence[str]) -> str:
    if not numeric:  # all text: two categories, or a mistake that the caller reports
        return "binary"
    return "binary" if len(numeric) == len(distinct) == 2 else "continuous"


def _as_number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan


def _number(path: Path, number: int, name: str, cell: str) -> float:
    value = _as_number(cell)
    if not math.isfinite(value):
        raise InputError(f"{path.name} row {number}, column '{name}' is '{cell}'; expected a number")
    return value


def _level(path: Path, number: int, name: str, cell: str, levels: tuple[str, str]) -> float:
    if cell not in levels:
        raise InputError(
            f"{path.name} row {number}, column '{name}' is '{cell}'; expected {levels[0]} or {levels[1]}"
        )
    return (-1.0, 1.0)[levels.index(cell)]


def _alignment(path: Path, settings: Mapping[str, Any], has_landmarks: bool) -> Alignment:
    method = settings.get("method", "landmarks" if has_landmarks else "none")
    if method not in METHODS:
        raise InputError(f"alignment method '{method}' in {path.stem}.toml; use {', '.join(METHODS)}")
    if method == "landmarks" and not has_landmarks:
        raise InputError(f"alignment by landmarks needs a column 'landmarks' in {path.name}")
    return Alignment(method, settings.get("origin", ""))


def population_from_table(table: ShapeTable, held_out: NDArray[np.bool_]) -> Population:
    """Set centre, scale and range of every covariate from the training rows.

    Continuous: mean, standard deviation (divided by n); binary: 0 and 1.

    Args:
        table: all rows.
        held_out: bool ``[n]``, true for rows that are not trained on.

    Raises:
        InputError: when a covariate does not vary over the training rows.
    """
    training = table.values[~held_out]
    covariates = tuple(_with_statistics(c, training[:, i]) for i, c in enumerate(table.covariates))
    return Population(
        covariates=covariates,
        subjects=tuple(row.subject for row in table.rows),
        visits=tuple(row.visit for row in table.rows),
        values=table.values,
        held_out=held_out,
    )


def _with_statistics(covariate: Covariate, values: NDArray[np.float64]) -> Covariate:
    if not len(values) or values.min() == values.max():
        raise InputError(f"covariate '{covariate.name}' does not vary over the training subjects; add data")
    observed = (float(values.min()), float(values.max()))
    if covariate.kind == "binary":
        return replace(covariate, centre=0.0, scale=1.0, range=observed)
    return replace(covariate, centre=float(values.mean()), scale=float(values.std()), range=observed)


def write_table(
    population: Population,
    path: str | Path,
    *,
    meshes: Sequence[str] = (),
    landmarks: Sequence[str] = (),
) -> None:
    """Write a population as the CSV that :func:`read_table` reads; units stand in the header.

    Args:
        population: the rows.
        path: the CSV to write.
        meshes: path of each row's mesh relative to the table; no such column when empty.
        landmarks: the same for the landmarks.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    files = {name: paths for name, paths in (("mesh", meshes), ("landmarks", landmarks)) if len(paths)}
    writer.writerow([*files, "subject", "visit", *(_title(c) for c in population.covariates)])
    for i, (subject, visit) in enumerate(zip(population.subjects, population.visits, strict=True)):
        cells = [_cell(c, float(population.values[i, j])) for j, c in enumerate(population.covariates)]
        writer.writerow([*(paths[i] for paths in files.values()), subject, visit, *cells])
    with replacing(Path(path)) as temporary:
        temporary.write_text(text.getvalue(), encoding="utf-8")


def _title(covariate: Covariate) -> str:
    return f"{covariate.name} [{covariate.unit}]" if covariate.unit else covariate.name


def _cell(covariate: Covariate, value: float) -> str:
    return covariate.levels[int(value > 0)] if covariate.kind == "binary" else repr(value)
