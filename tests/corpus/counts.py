"""How many cases of each kind ended how, as a table in a document."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from corpus.kinds import TITLES

COMMAND = "    make fuzz"
"""The line of a document that such a table stands below."""

Ended = Literal["success", "refused", "failed"]
_BLOCK = re.compile(rf"(?<=^{re.escape(COMMAND)}$)(?P<between>(?:\n(?!\|).*)*?\n)(?:\|.*\n)+", re.MULTILINE)


@dataclass(frozen=True)
class Counts:
    """What was counted so far.

    Attributes:
        ended: how many of a kind ended how.
    """

    ended: Counter[tuple[str, Ended]] = field(default_factory=Counter)

    def markdown(self) -> str:
        """A row each kind, and one of the sums."""
        rows = [self._row(title, [kind]) for kind, title in TITLES.items()]
        head = ["| input | cases | success | one sentence | failed |", "| --- | ---: | ---: | ---: | ---: |"]
        return "\n".join([*head, *rows, self._row("together", list(TITLES)), ""])

    def _row(self, title: str, kinds: Sequence[str]) -> str:
        columns: tuple[Ended, ...] = ("success", "refused", "failed")
        numbers = [sum(self.ended[kind, each] for kind in kinds) for each in columns]
        return f"| {title} | {sum(numbers):,} | {' | '.join(f'{number:,}' for number in numbers)} |"


def with_table(text: str, table: str) -> str:
    """A document with another table below the command.

    Raises:
        ValueError: when the document has no such command or no table below it.
    """
    changed, count = _BLOCK.subn(lambda found: found["between"] + table, text)
    if count != 1:
        raise ValueError(f"there is no table below '{COMMAND.strip()}'")
    return changed
