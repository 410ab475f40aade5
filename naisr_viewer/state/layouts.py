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

    @property
    def needs_fit(self) -> bool:
        """Whether it is about a fitted patient."""
        return self in (Layout.FIT, Layout.CHANGE)

    @property
    def is_forecast(self) -> bool:
        """Whether it shows the patient at other covariates, or against another one."""
        return self is Layout.CHANGE


@dataclass(frozen=True)
class Panel:
    """One sub-plot: what ``kind`` of view it is, and of which covariate where the kind is about one."""

    kind: str
    covariate: str = ""


TEMPLATE = Panel("template")
FULL_SHAPE = Panel("shape")
"""The two that others are made from."""
