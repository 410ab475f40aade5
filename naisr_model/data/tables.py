"""The user's table: one row a mesh, with the subject, the visit and the covariates.

Columns: ``mesh`` (path, relative to the table), ``subject``, optionally ``visit`` (numbered when
absent) and ``landmarks`` (path of a CSV ``name,x,y,z``, or of 3D Slicer's ``.fcsv`` or ``.mrk.json``);
every other column is a covariate. A header may carry a unit: ``age [months]`` or ``weight (kg)``. Any file
that :mod:`naisr_model.data.sheets` reads will do. A TOML file with the same stem may add to it::

    name = "airway"
    unit = "mm"  # of length; of curves in the plane it may be any
    [covariates.sex]
    kind = "binary"
    levels = ["F", "M"]
    [alignment]
    method = "landmarks"
    origin = "true vocal cords"
"""

from __future__ import annotations

import contextlib
import csv
import io
import os
import re
import tomllib
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PureWindowsPath
from typing import Any, get_args
from urllib.parse import unquote, urlparse

import numpy as np
from numpy.typing import NDArray

from naisr_model.covariates import Covariate, Kind, Population
from naisr_model.data.align import METHODS, Alignment
from naisr_model.data.columns import Column, Fault, Understood, read_column, refuse
from naisr_model.data.remarks import Remark
from naisr_model.data.sheets import Sheet, numbered, read_sheet, read_text, split_title
from naisr_model.errors import InputError
from naisr_model.files import replacing
from naisr_model.numerals import IS_MISSING, decimal_marks, is_missing

RESERVED = ("mesh", "subject", "visit", "landmarks")
_OWN = ("name", "unit")
_TABLES = ("covariates", "alignment", "source")
_ALIGNMENT_KEYS = ("method", "origin")


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
        told: how each covariate was understood, a line each.
        remarks: what looks wrong in the table, or was set right; values far from the others first.
        codes: of each row, what is almost surely a code for a missing value; the values are NaN there.
        accepted: rows, by number, that are right whatever is suspected of them.
        unit: of length.
    """

    name: str
    rows: tuple[TableRow, ...]
    covariates: tuple[Covariate, ...]
    values: NDArray[np.float64]
    alignment: Alignment
    source: dict[str, Any]
    told: tuple[str, ...]
    remarks: tuple[Remark, ...]
    codes: tuple[tuple[Remark, ...], ...]
    accepted: frozenset[int]
    unit: str = "mm"

    @property
    def summary(self) -> tuple[str, ...]:
        """What was understood, for people, and where to say otherwise."""
        subjects = len({row.subject for row in self.rows})
        counted = f"{self.name}: {len(self.rows)} rows, {subjects} subjects"
        toml = "unit, kind or levels of a covariate can be set in the TOML beside the table"
        return (counted, *(f"  {line}" for line in self.told), f"  ({toml})")

    def take(self, indices: Sequence[int]) -> ShapeTable:
        """The table with only some of its rows."""
        rows, codes = tuple(self.rows[i] for i in indices), tuple(self.codes[i] for i in indices)
        return replace(self, rows=rows, codes=codes, values=self.values[list(indices)])


def read_table(path: str | Path, accepted: Collection[int] = ()) -> ShapeTable:
    """Read ``path`` and the TOML beside it.

    The kind of a covariate is guessed where the TOML does not give it: words, or two distinct numbers
    without a unit, make it binary, the first in sorted order being -1. Where there is a ``landmarks``
    column, alignment by landmarks is the default.

    Args:
        path: of the table.
        accepted: rows, by number, that are right whatever is suspected of them, as a true 999 is.

    Raises:
        InputError: naming all rows and columns that cannot be used, or an accepted row that is not there.
    """
    path = Path(path)
    sheet = read_sheet(path)
    titles = titles_of(path, sheet)
    extra = _read_toml(path.with_suffix(".toml"))
    names = [name for name in titles if name not in RESERVED]
    if not names:
        raise InputError(f"{path.name} has no covariate; add a column such as 'age [months]'")
    _known_only(path, extra, names)
    if len(sheet.lines) == 1:
        raise InputError(f"{path.name} has one row, of which nothing can be learned; add one row a mesh")
    rows, faults = _rows(path, sheet, titles)
    _require_rows(path, rows, accepted)
    readings = _readings(path, sheet, titles, extra.get("covariates", {}), accepted)
    refuse(path.name, [*faults, *(fault for reading in readings for fault in reading.faults)])
    return ShapeTable(
        name=extra.get("name", path.stem),
        rows=rows,
        covariates=tuple(reading.covariate for reading in readings),
        values=np.stack([reading.values for reading in readings], axis=1),
        alignment=_alignment(path, extra.get("alignment", {}), "landmarks" in titles),
        source=dict(extra.get("source", {})),
        told=tuple(reading.told for reading in readings),
        remarks=(
            *sheet.remarks,
            *_one_subject(rows),
            *sorted(
                (remark for reading in readings for remark in reading.remarks),
                key=lambda remark: remark.topic != "outlier",
            ),
        ),
        codes=tuple(
            tuple(reading.codes[row.number] for reading in readings if row.number in reading.codes)
            for row in rows
        ),
        accepted=frozenset(accepted),
        unit=extra.get("unit", "mm"),
    )


def _require_rows(path: Path, rows: Sequence[TableRow], accepted: Collection[int]) -> None:
    if gone := sorted(set(accepted) - {row.number for row in rows}):
        ends = f"{rows[0].number} to {rows[-1].number}, the header being 1"
        raise InputError(f"{path.name} has no row {gone[0]} to accept; its rows are {ends}")


def _one_subject(rows: Sequence[TableRow]) -> tuple[Remark, ...]:
    if len({row.subject for row in rows}) > 1:
        return ()
    sentence = "all rows are of one subject, so differences between people cannot be learned"
    return (Remark("look", "subjects", sentence, "look whether the column 'subject' is right"),)


def titles_of(path: Path, sheet: Sheet) -> dict[str, tuple[str, str]]:
    """Title and unit of each column by its name; those that are :data:`RESERVED` in small letters.

    Raises:
        InputError: when two names differ in their letters only, there is no column of subjects, or no row.
    """
    named: dict[str, tuple[str, str]] = {}
    for title in sheet.titles:
        name, unit = split_title(title)
        if name.casefold() in RESERVED:
            name = name.casefold()
        if same := [other for other in named if other.casefold() == name.casefold()]:
            alike = f"'{name}' twice" if same[0] == name else f"both '{same[0]}' and '{name}'"
            raise InputError(f"{path.name} has the column {alike}; rename one")
        named[name] = title, unit
    if "" in named:
        raise InputError(f"{path.name} has a column without a name; name it or remove it")
    if "subject" not in named:
        raise InputError(f"{path.name} has no column 'subject'; it has {', '.join(named) or 'none'}")
    if not sheet.lines:
        raise InputError(f"{path.name} has a header but no rows; add one row a mesh")
    return named


def _read_toml(path: Path) -> dict[str, Any]:
    if not path.is_file():
        return {}
    try:
        return tomllib.loads(read_text(path)[0])
    except (RecursionError, ValueError) as error:
        raise InputError(f"{path.name} is not valid TOML ({error}); correct it") from error


def _known_only(path: Path, extra: Mapping[str, Any], names: Sequence[str]) -> None:
    toml = f"{path.stem}.toml"
    if unknown := sorted(set(extra) - {*_OWN, *_TABLES}):
        raise InputError(f"{toml} has '{unknown[0]}'; it may have {', '.join((*_OWN, *_TABLES))}")
    for key in _TABLES:
        if not isinstance(extra.get(key, {}), dict):
            raise InputError(f"'{key}' in {toml} must be a table, such as [{key}]")
    alignment = extra.get("alignment", {})
    if unknown := sorted(set(alignment) - set(_ALIGNMENT_KEYS)):
        raise InputError(f"[alignment] in {toml} has '{unknown[0]}'; it may have method and origin")
    _texts_only(toml, {key: extra.get(key, "") for key in _OWN} | alignment)
    for name, settings in extra.get("covariates", {}).items():
        if name not in names:
            has = ", ".join(names)
            raise InputError(f"{toml} describes '{name}', which is not a column of {path.name}; it has {has}")
        if not isinstance(settings, dict) or set(settings) - {"unit", "kind", "levels"}:
            raise InputError(f"[covariates.{name}] in {toml} may have unit, kind and levels only")
        _texts_only(toml, {key: value for key, value in settings.items() if key != "levels"})
        _check_levels(toml, name, settings.get("levels", []))
        if (kind := settings.get("kind", "binary")) not in get_args(Kind):
            raise InputError(f"'{name}' has the kind '{kind}' in {toml}; use continuous or binary")
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


def _rows(
    path: Path, sheet: Sheet, titles: Mapping[str, tuple[str, str]]
) -> tuple[tuple[TableRow, ...], list[Fault]]:
    """What each row is about; every cell that must hold something and does not."""
    seen: Counter[str] = Counter()
    rows: list[TableRow] = []
    faults: list[Fault] = []
    own = {name: sheet.column(titles[name][0]) for name in RESERVED if name in titles}
    for i, line in enumerate(sheet.lines):
        cells = {name: column[i] for name, column in own.items()}
        needed = [name for name in cells if name != "landmarks"]
        faults += [Fault(line.number, n, cells[n], IS_MISSING) for n in needed if is_missing(cells[n])]
        seen[cells["subject"]] += 1
        marks = cells.get("landmarks", "")
        rows.append(
            TableRow(
                number=line.number,
                mesh=located(path.parent, cells.get("mesh", "")),
                subject=cells["subject"],
                visit=cells.get("visit", str(seen[cells["subject"]])),
                landmarks=None if is_missing(marks) else located(path.parent, marks),
            )
        )
    if not faults:
        _refuse_repeated(path, rows)
    return tuple(rows), faults


def _refuse_repeated(path: Path, rows: Sequence[TableRow]) -> None:
    found: dict[tuple[str, str], list[int]] = {}
    for row in rows:
        found.setdefault((row.subject, row.visit), []).append(row.number)
    repeated = {key: numbers for key, numbers in found.items() if len(numbers) > 1}
    if not repeated:
        return
    (subject, visit), numbers = next(iter(repeated.items()))
    more = f", and {len(repeated) - 1} more visits are there again" if len(repeated) > 1 else ""
    raise InputError(
        f"{path.name} {numbered(numbers)} are {'both' if len(numbers) == 2 else 'all'} visit '{visit}' of "
        f"subject '{subject}'{more}; give each visit its own name"
    )


def located(folder: Path, text: str) -> Path:
    """The file that a cell names, also by ``~/``, by a ``file://`` address or with backslashes."""
    if text.lower().startswith("file:"):
        text = unquote(urlparse(text).path)
    written = folder / (os.path.expanduser(text) if text.startswith(("~/", "~\\")) else text)
    if "\\" not in text or os.path.exists(written):
        return written
    return located(folder, PureWindowsPath(text).as_posix())


def require_file(path: Path) -> None:
    """Make sure that a file that the table names is there.

    Raises:
        InputError: with what is there instead.
    """
    if os.path.exists(path):
        return
    text = str(path)
    if re.search(r"(^|/)[A-Za-z]:/", text.replace("\\", "/")) and os.sep == "/":
        raise InputError(f"{path} does not exist; it is a path of Windows, write it relative to the table")
    if re.search(r"\b(https?|s3|ftp):/", text):
        raise InputError(f"{path} does not exist; it is an address, copy the file beside the table")
    names: list[str] = []
    with contextlib.suppress(OSError):
        names = os.listdir(path.parent)
    if alike := [name for name in names if name.casefold() == path.name.casefold()]:
        raise InputError(f"{path} does not exist; there is '{alike[0]}', so spell it alike")
    raise InputError(f"{path} does not exist; correct the path")


def missing_files(table: ShapeTable) -> tuple[str, ...]:
    """A sentence for each file that the table names and that is not there."""
    found = []
    for row in table.rows:
        for path in (row.mesh, row.landmarks):
            try:
                if path is not None:
                    require_file(path)
            except InputError as error:
                found.append(f"row {row.number}: {error}")
    return tuple(found)


def _readings(
    path: Path,
    sheet: Sheet,
    titles: Mapping[str, tuple[str, str]],
    settings: Mapping[str, Any],
    accepted: Collection[int],
) -> list[Understood]:
    """Every covariate as it is understood."""
    numbers = tuple(line.number for line in sheet.lines)
    columns = [
        Column(name, _unit(path, name, unit, own), own, numbers, sheet.column(title))
        for name, (title, unit) in titles.items()
        if name not in RESERVED
        for own in (settings.get(name, {}),)
    ]
    marks = decimal_marks(cell for column in columns for cell in column.cells)
    return [read_column(column, marks, accepted) for column in columns]


def _unit(path: Path, name: str, header_unit: str, settings: Mapping[str, Any]) -> str:
    unit: str = settings.get("unit", header_unit)
    if header_unit and unit != header_unit:
        raise InputError(
            f"'{name}' is in {header_unit} by the header of {path.name} but in {unit} by {path.stem}.toml; "
            f"make them agree"
        )
    return unit


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
