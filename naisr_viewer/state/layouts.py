"""Which arrangements of sub-plots there are, and what one sub-plot is."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Layout(StrEnum):
    """How the sub-plots share the window."""

    SIDE_BY_SIDE = "side by side"
    FULL_SHAPE = "full shape"
    FIT = "fit"
    CHANGE = "before and after"
    MATRIX = "matrix"

    @property
    def needs_fit(self) -> bool:
        """Whether it is about a fitted patient."""
        return self in (Layout.FIT, Layout.CHANGE)

    @property
    def is_forecast(self) -> bool:
        """Whether it shows the patient at other covariates, or against another one."""
        return self is Layout.CHANGE


Cell = tuple[int, int]
"""Column and row in the matrix; 0 is where an axis stands."""


@dataclass(frozen=True)
class Panel:
    """One sub-plot.

    Attributes:
        kind: what kind of view it is.
        covariate: which one, where the kind is about one.
        cell: which one of the matrix, where the kind is laid out in cells.
    """

    kind: str
    covariate: str = ""
    cell: Cell | None = None


TEMPLATE = Panel("template")
FULL_SHAPE = Panel("shape")
"""The two that others are made from."""
