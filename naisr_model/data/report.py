"""What became of a table: which rows are in the store, which are not and why, and what to look at.

What matters stands first, what many rows share is said once and counted.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from naisr_model.data.remarks import SEVERITIES, Remark
from naisr_model.data.sheets import numbered

MOST_ALIKE = 5
"""Of more rows with the same kind of trouble one is shown, and the others are counted."""

WORDS = {"refuse": "rejected", "look": "look", "fine": "fine"}
"""How a command says how grave a remark is."""


@dataclass(frozen=True)
class RowRemark:
    """Something about one row of the table.

    Attributes:
        row: its line in the file; the header is 1.
        path: of its mesh.
        remark: what is the matter.
    """

    row: int
    path: str
    remark: Remark

    @property
    def reason(self) -> str:
        """What is the matter and what to do."""
        return self.remark.text

    def __str__(self) -> str:
        return f"{self.path} (row {self.row}): {self.reason}"

    def to_json(self) -> dict[str, Any]:
        """For programs."""
        return {"row": self.row, "path": self.path, "reason": self.reason, **self.remark.to_json()}


@dataclass(frozen=True)
class PreparationReport:
    """What became of each row of the table; rows by line number, the header being 1.

    Attributes:
        accepted: rows that are in the store.
        skipped: those of them whose samples an earlier run had already written.
        rejected: rows that could not be used, with the reason.
        warnings: rows that were used although something is odd.
        understood: how each covariate was understood.
        table: what is odd about the table as a whole.
    """

    accepted: tuple[int, ...]
    skipped: tuple[int, ...]
    rejected: tuple[RowRemark, ...]
    warnings: tuple[RowRemark, ...]
    understood: tuple[str, ...] = ()
    table: tuple[Remark, ...] = ()

    @property
    def lines(self) -> tuple[str, ...]:
        """All rejected rows, then what to look at, for people."""
        return (*map(rejected, self.rejected), *summary(self.warnings))

    def to_json(self) -> dict[str, Any]:
        """A plain dictionary for ``report.json``."""
        return {
            "accepted": list(self.accepted),
            "skipped": list(self.skipped),
            "rejected": [remark.to_json() for remark in self.rejected],
            "warnings": [remark.to_json() for remark in self.warnings],
            "understood": list(self.understood),
            "table": [remark.to_json() for remark in self.table],
        }


def rejected(remark: RowRemark) -> str:
    """One row that was left out, for people."""
    return f"{WORDS['refuse']} {remark}"


def summary(remarks: Iterable[RowRemark]) -> tuple[str, ...]:
    """Remarks for people: the gravest first, and of equally grave ones what fewest rows have.

    What is the matter with one mesh of a hundred matters more than what is the matter with all.
    """
    topics: dict[tuple[str, str], list[RowRemark]] = {}
    for one in remarks:
        topics.setdefault((one.remark.severity, one.remark.topic), []).append(one)
    order = sorted(
        topics.values(), key=lambda alike: (SEVERITIES.index(alike[0].remark.severity), len(alike))
    )
    return tuple(line for alike in order for line in _told(alike))


def _told(alike: Sequence[RowRemark]) -> list[str]:
    word = WORDS[alike[0].remark.severity]
    if len(alike) <= MOST_ALIKE:
        return [f"{word} {one}" for one in alike]
    rows = numbered([one.row for one in alike])
    return [f"{word} {len(alike)} rows, '{alike[0].remark.topic}' ({rows}), such as {alike[0]}"]
