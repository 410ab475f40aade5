"""The results of a cohort as one table: a row a scan, a column a number, as CSV and as Parquet."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from naisr_model.atlas import Atlas
from naisr_model.cohorts.table import CohortRow, CohortTable
from naisr_model.covariates import Covariate
from naisr_model.errors import InputError
from naisr_model.measures.kinds import MEASURES
from naisr_model.measures.norms import Norms
from naisr_model.work.journal import Record

Cell = str | float | int | None
"""None where nothing is known."""

ABOUT = ("row", "subject", "visit", "mesh")
FOUND = ("status", "reason")

_ASCII = str.maketrans({"²": "2", "³": "3"})


@dataclass(frozen=True)
class Outcome:
    """What became of one row.

    Attributes:
        row: of the table.
        record: see :func:`~naisr_model.cohorts.rows.fit_row`.
    """

    row: CohortRow
    record: Record

    @property
    def reason(self) -> str:
        """Why there is no result, a sentence; empty where there is one."""
        if "reason" in self.record:
            return str(self.record["reason"])
        return "" if self.record["is_valid"] else "; ".join(self.record["remarks"])

    @property
    def remarks(self) -> tuple[str, ...]:
        """What is odd about the scan, gravest first, then about the fit."""
        if self.reason:
            return ()
        scan = self.record["patient"]
        read = [": ".join((one["severity"], one["sentence"])) for one in scan["remarks"]]
        return (*read, *self.record["remarks"])


@dataclass(frozen=True, eq=False)
class Cohort:
    """Everything that was found out about a table.

    Attributes:
        table: as it was understood.
        outcomes: one a row, in the order of the table.
        atlas: that was fitted.
        norms: what is usual among its people; None where nobody knows.
        without: why there are no percentiles, a sentence; empty where there are.
    """

    table: CohortTable
    outcomes: tuple[Outcome, ...]
    atlas: Atlas
    norms: Norms | None
    without: str

    @cached_property
    def fitted(self) -> tuple[Outcome, ...]:
        """Those with a result."""
        return tuple(one for one in self.outcomes if not one.reason)

    @cached_property
    def rejected(self) -> tuple[Outcome, ...]:
        """Those without."""
        return tuple(one for one in self.outcomes if one.reason)

    @property
    def residual(self) -> str:
        """Under which name a record holds the residual."""
        return f"residual_{self.atlas.frame.unit}"


def require_distinct(table: CohortTable, atlas: Atlas) -> None:
    """Make sure before the work that no two columns of the results will have the same name.

    Raises:
        InputError: naming one that would be there twice.
    """
    expected = _names(table, atlas, {name: _column(name, one.unit) for name, one in MEASURES.items()})
    if twice := [name for name, count in Counter(expected).items() if count > 1]:
        raise InputError(f"the results have a column '{twice[0]}' of their own; rename that of {table.name}")


def columns(cohort: Cohort) -> dict[str, list[Cell]]:
    """The results by the name of the column, rows in the order of the table.

    What was given of a covariate has no interval. A binary covariate goes by its levels. ``remarks`` are
    joined by ``|``. The code z is in ``code_1`` and so on. Of a rejected row only the reason is told.
    """
    measured = _measured(cohort.fitted)
    names = _names(cohort.table, cohort.atlas, measured)
    rows = [_cells(one, cohort, measured) for one in cohort.outcomes]
    return {name: [row.get(name) for row in rows] for name in names}


def as_csv(cohort: Cohort) -> bytes:
    """The results as text, UTF-8; a cell without a value is empty."""
    table, text = columns(cohort), io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table)
    writer.writerows(zip(*table.values(), strict=True))
    return text.getvalue().encode()


def as_parquet(cohort: Cohort) -> bytes:
    """The same as Parquet: whole numbers, doubles and texts; a cell without a value is null."""
    import pyarrow
    import pyarrow.parquet

    arrays = {name: pyarrow.array(cells, _type(cells)) for name, cells in columns(cohort).items()}
    target = pyarrow.BufferOutputStream()
    pyarrow.parquet.write_table(pyarrow.table(arrays), target)
    return bytes(target.getvalue().to_pybytes())


def _type(cells: Sequence[Cell]) -> str:
    kinds = {type(cell) for cell in cells if cell is not None}
    if kinds == {int}:
        return "int64"
    return "string" if str in kinds else "float64"


def _measured(fitted: Sequence[Outcome]) -> dict[str, str]:
    """The column of each measure that somebody has, by its name."""
    found = {name: one["unit"] for each in fitted for name, one in each.record["measures"].items()}
    return {name: _column(name, unit) for name, unit in found.items()}


def _column(name: str, unit: str) -> str:
    return f"{name}_{unit.translate(_ASCII)}"


def _names(table: CohortTable, atlas: Atlas, measured: Mapping[str, str]) -> list[str]:
    extent = atlas.extent
    shape = [extent.key(), extent.key("low"), extent.key("high"), f"{extent.title}_percentile"]
    for name, column in measured.items():
        shape += [column, f"{name}_percentile"] if name != extent.title else []
    covariates = [name for one in atlas.covariates for name in (one.name, *_ends(one))]
    codes = [f"code_{number}" for number in range(1, atlas.checkpoint.preset.network.latent + 1)]
    fit = [f"residual_{atlas.frame.unit}", f"scan_{extent.key()}", "alignment", "remarks", "seconds"]
    return [*ABOUT, *table.copied, *FOUND, *covariates, "inferred", *shape, *fit, *codes]


def _ends(covariate: Covariate) -> tuple[str, str]:
    return f"{covariate.name}_low", f"{covariate.name}_high"


def _cells(one: Outcome, cohort: Cohort, measured: Mapping[str, str]) -> dict[str, Cell]:
    row, table = one.row, cohort.table
    place = "" if row.scan == Path() else str(row.scan)
    about: dict[str, Cell] = dict(zip(ABOUT, (row.number, row.subject, row.visit, place), strict=True))
    copied = dict(zip(table.copied, row.copied, strict=True))
    cells: dict[str, Cell] = {**about, **copied, "status": "rejected", "reason": one.reason}
    if one.reason:
        return cells
    cells |= {"status": "fitted", **_covariate_cells(one, cohort.atlas.covariates)}
    return cells | _shape_cells(one, cohort, measured)


def _covariate_cells(one: Outcome, covariates: Sequence[Covariate]) -> dict[str, Cell]:
    """What is known as it was given, to the last digit, and what was found of the others."""
    record, values = one.record, {**one.record["covariates"], **dict(one.row.known)}
    cells: dict[str, Cell] = {"inferred": ", ".join(record["inferred"])}
    for covariate in covariates:
        cells[covariate.name] = _value(covariate, values[covariate.name])
        for name, end in zip(_ends(covariate), record["intervals"].get(covariate.name, ()), strict=False):
            cells[name] = _value(covariate, end)
    return cells


def _value(covariate: Covariate, value: float) -> Cell:
    return covariate.format(value) if covariate.kind == "binary" else value


def _shape_cells(one: Outcome, cohort: Cohort, measured: Mapping[str, str]) -> dict[str, Cell]:
    record, extent = one.record, cohort.atlas.extent
    low, high = record[extent.key("interval")]
    cells: dict[str, Cell] = {
        extent.key("low"): low,
        extent.key("high"): high,
        cohort.residual: record[cohort.residual],
        f"scan_{extent.key()}": record["patient"][extent.key()],
        "alignment": (record["patient"]["alignment"] or {}).get("method", ""),
        "remarks": " | ".join(one.remarks),
        "seconds": round(record["seconds"], 3),
    }
    for name, found in record["measures"].items():
        cells |= {measured[name]: found["value"], f"{name}_percentile": found.get("percentile")}
    return cells | {f"code_{number}": value for number, value in enumerate(record["latent"], start=1)}
