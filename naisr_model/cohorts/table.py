"""The table of a cohort: one row a scan, with what is known of it; blanks are inferred.

Columns: ``mesh`` (path, relative to the table) and ``subject``; optionally ``visit`` (numbered when absent),
``label`` (of a label volume) and ``landmarks``. A column with the name of a covariate of the atlas holds what
is known, and every other one is copied into the results. Any file that :mod:`naisr_model.data.sheets` reads
will do.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from naisr_model.covariates import Covariate, complete
from naisr_model.data.remarks import Remark
from naisr_model.data.sheets import numbered, read_sheet
from naisr_model.data.tables import located, require_file, titles_of
from naisr_model.errors import InputError
from naisr_model.numerals import is_missing

OWN = ("mesh", "subject", "visit", "label", "landmarks")
"""Columns that say what is read, and of whom."""

Known = tuple[tuple[str, float], ...]
"""Real covariate values by name; it can be hashed."""


@dataclass(frozen=True)
class CohortRow:
    """One scan.

    Attributes:
        number: line in the file as a spreadsheet shows it; the header is 1.
        subject: who it is.
        visit: which of the subject's visits.
        scan: path of the mesh, label volume, cloud or curve.
        label: of a label volume, its number or its name; None where the table gives none.
        landmarks: path of the landmarks, or None.
        known: covariates that are given; the others are inferred.
        copied: the cells under other titles, in their order.
        fault: why it cannot be used, a sentence; empty where the table alone shows nothing.
    """

    number: int
    subject: str
    visit: str
    scan: Path
    label: str | None = None
    landmarks: Path | None = None
    known: Known = ()
    copied: tuple[str, ...] = ()
    fault: str = ""


@dataclass(frozen=True)
class CohortTable:
    """A table that was read.

    Attributes:
        name: of the file.
        rows: one a scan.
        given: names of the covariates that have a column.
        inferred: names of those that have none.
        copied: titles of the other columns.
        remarks: what was odd about the file.
    """

    name: str
    rows: tuple[CohortRow, ...]
    given: tuple[str, ...]
    inferred: tuple[str, ...]
    copied: tuple[str, ...]
    remarks: tuple[Remark, ...]

    @property
    def summary(self) -> tuple[str, ...]:
        """What was understood, for people."""
        subjects = len({row.subject for row in self.rows})
        told = [f"{self.name}: {len(self.rows)} rows, {subjects} subjects"]
        if self.given:
            told.append(f"  known where a cell is filled in: {', '.join(self.given)}")
        if self.inferred:
            told.append(f"  inferred of everybody, without a column: {', '.join(self.inferred)}")
        if self.copied:
            told.append(f"  no covariates of the atlas, copied: {', '.join(self.copied)}")
        return (*told, *(f"{one.severity}: {one.text}" for one in self.remarks))


def read_cohort(path: str | Path, covariates: Sequence[Covariate]) -> CohortTable:
    """Read a table of scans for an atlas with these covariates.

    What is wrong with a row stands in its ``fault`` and stops no other.

    Raises:
        InputError: when the file cannot be read, has no rows, lacks a column, or gives a covariate in
            another unit than the atlas.
    """
    path = Path(path)
    sheet = read_sheet(path)
    found = titles_of(path, sheet)
    titles = {(name.casefold() if name.casefold() in OWN else name): each for name, each in found.items()}
    if "mesh" not in titles:
        raise InputError(f"{path.name} has no column 'mesh'; add one with the path of each scan")
    named = _covariate_columns(path, titles, covariates)
    copied = tuple(name for name in titles if name not in OWN and name not in named.values())
    columns = {name: sheet.column(title) for name, (title, _) in titles.items()}
    rows = [
        replace(
            _row(path.parent, {name: column[i] for name, column in columns.items()}, covariates, named),
            number=line.number,
            copied=tuple(columns[name][i] for name in copied),
        )
        for i, line in enumerate(sheet.lines)
    ]
    return CohortTable(
        name=path.name,
        rows=tuple(_without_repeated(_visited(rows))),
        given=tuple(named),
        inferred=tuple(one.name for one in covariates if one.name not in named),
        copied=copied,
        remarks=sheet.remarks,
    )


def _covariate_columns(
    path: Path, titles: Mapping[str, tuple[str, str]], covariates: Sequence[Covariate]
) -> dict[str, str]:
    """The column of each covariate that has one, by its name."""
    folded = {name.casefold(): name for name in titles if name not in OWN}
    found = {one.name: folded[one.name.casefold()] for one in covariates if one.name.casefold() in folded}
    for covariate in covariates:
        unit = titles[found[covariate.name]][1] if covariate.name in found else ""
        if unit and unit.casefold() != covariate.unit.casefold():
            raise InputError(
                f"'{covariate.name}' is in {unit} by the header of {path.name}, and the atlas has it "
                f"{f'in {covariate.unit}' if covariate.unit else 'without a unit'}; convert the column"
            )
    return found


def _row(
    folder: Path, cells: Mapping[str, str], covariates: Sequence[Covariate], named: Mapping[str, str]
) -> CohortRow:
    """One row, still without its number and what is copied."""
    faults = [f"there is no {name}; fill it in" for name in ("mesh", "subject") if is_missing(cells[name])]
    known: list[tuple[str, float]] = []
    for covariate in covariates:
        text = cells[named[covariate.name]] if covariate.name in named else ""
        try:
            if not is_missing(text):
                value = covariate.parse(text)
                complete((covariate,), {covariate.name: value})
                known.append((covariate.name, value))
        except InputError as error:
            faults.append(str(error))
    files = {name: _file(folder, cells.get(name, "")) for name in ("mesh", "landmarks")}
    for file in files.values():
        try:
            if file is not None:
                require_file(file)
        except InputError as error:
            faults.append(str(error))
    label = cells.get("label", "")
    return CohortRow(
        number=0,
        subject=cells["subject"],
        visit=cells.get("visit", ""),
        scan=files["mesh"] or Path(),
        label=None if is_missing(label) else label,
        landmarks=files["landmarks"],
        known=tuple(known),
        fault="; ".join(faults),
    )


def _file(folder: Path, text: str) -> Path | None:
    return None if is_missing(text) else located(folder, text)


def _visited(rows: Sequence[CohortRow]) -> list[CohortRow]:
    """Rows without a visit get a number among those of their subject."""
    seen: Counter[str] = Counter()
    found = []
    for row in rows:
        seen[row.subject] += 1
        found.append(replace(row, visit=str(seen[row.subject])) if is_missing(row.visit) else row)
    return found


def _without_repeated(rows: Sequence[CohortRow]) -> list[CohortRow]:
    """Nobody can tell which of two rows of one visit is right: neither is used."""
    numbers: dict[tuple[str, str], list[int]] = {}
    for row in rows:
        numbers.setdefault((row.subject, row.visit), []).append(row.number)
    return [_repeated(row, numbers[row.subject, row.visit]) for row in rows]


def _repeated(row: CohortRow, alike: Sequence[int]) -> CohortRow:
    if len(alike) == 1 or row.fault:
        return row
    who = f"visit '{row.visit}' of subject '{row.subject}'"
    return replace(row, fault=f"{numbered(alike)} are {who}; give each visit its own name")
