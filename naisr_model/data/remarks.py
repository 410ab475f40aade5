"""What is said about something that came in: what is the matter, how grave it is, and what to do.

>>> remarks = [Remark("fine", "faces", "3 faces without area were dropped"),
...            Remark("refuse", "units", "the shape is 0.2 mm long", "scale it by 1000")]
>>> [remark.text for remark in gravest_first(remarks)]
['the shape is 0.2 mm long; scale it by 1000', '3 faces without area were dropped']
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import asdict, dataclass, replace
from typing import Literal

Severity = Literal["refuse", "look", "fine"]

SEVERITIES: tuple[Severity, ...] = ("refuse", "look", "fine")
"""``refuse``: it cannot be used as it is. ``look``: a person has to look before the result is trusted.
``fine``: it was set right, or does no harm; told so that nobody wonders later."""


@dataclass(frozen=True)
class Remark:
    """Something about a file, a shape or a row of a table.

    Attributes:
        severity: how grave it is, see :data:`SEVERITIES`.
        topic: one word for the kind of trouble, such as ``units``; remarks of one topic are counted together.
        sentence: what is the matter.
        remedy: what to do; empty where there is nothing to be done.
    """

    severity: Severity
    topic: str
    sentence: str
    remedy: str = ""

    @property
    def text(self) -> str:
        """For people: what is the matter and what to do."""
        return f"{self.sentence}; {self.remedy}" if self.remedy else self.sentence

    def to_json(self) -> dict[str, str]:
        """For programs."""
        return asdict(self)


def answerable(remark: Remark, row: int, accepted: Collection[int]) -> Remark:
    """A suspicion that refuses a row: with how to say that it is right, or as such where somebody did.

    Args:
        remark: on the row.
        row: of a table, as a spreadsheet counts.
        accepted: rows that somebody has looked at.
    """
    if remark.severity != "refuse":
        return remark
    if row in accepted:
        return replace(remark, severity="look", remedy=f"it was kept by --accept {row}")
    return replace(remark, remedy=f"{remark.remedy}, or keep it with --accept {row} if it is right")


def gravest_first(remarks: Iterable[Remark]) -> tuple[Remark, ...]:
    """In the order in which a person should read them; equally grave ones stay in theirs."""
    return tuple(sorted(remarks, key=lambda remark: SEVERITIES.index(remark.severity)))
