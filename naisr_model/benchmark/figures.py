"""One number of the benchmark, with what is measured and what is aimed at."""

from __future__ import annotations

import math
from dataclasses import dataclass

Figures = dict[str, float]
"""Numbers by key."""


@dataclass(frozen=True)
class Figure:
    """One number of the benchmark.

    Attributes:
        key: its name in the record.
        unit: of the number; empty for ratios and exponents.
        definition: what exactly is measured.
        at_least: the target, if more is better.
        at_most: the target, if less is better.
    """

    key: str
    unit: str
    definition: str
    at_least: float | None = None
    at_most: float | None = None

    @property
    def target(self) -> str:
        """The target in words, empty without one."""
        if self.at_least is not None:
            return f"≥ {self.at_least:g} {self.unit}".rstrip()
        return "" if self.at_most is None else f"≤ {self.at_most:g} {self.unit}".rstrip()

    def verdict(self, value: float) -> str:
        """Whether the target is met: yes, no, or empty without a target."""
        if self.at_least is None and self.at_most is None:
            return ""
        low = -math.inf if self.at_least is None else self.at_least
        high = math.inf if self.at_most is None else self.at_most
        return "yes" if low <= value <= high else "no"
