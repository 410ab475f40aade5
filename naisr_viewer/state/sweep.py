"""A covariate that goes to and fro by itself."""

from __future__ import annotations

from dataclasses import dataclass

from naisr_model.covariates import Covariate
from naisr_viewer.state.explorer import ExplorerState


@dataclass(frozen=True)
class Sweep:
    """To and fro through the observed range.

    Attributes:
        covariate: which.
        start: share of the range that lies below where it begins, upwards.
    """

    covariate: Covariate
    start: float

    def after(self, sweeps: float) -> float:
        """The real value after so many times the whole range, as round as it is shown."""
        low, high = self.covariate.range
        share = 1 - abs(1 - (self.start + sweeps) % 2)
        return min(max(round(low + share * (high - low), self.covariate.decimals), low), high)


def sweep_of(state: ExplorerState, name: str = "") -> Sweep | None:
    """Of a covariate, else of the one that was moved last, from where it is; None where there are none."""
    if state.atlas is None or not state.atlas.covariates:
        return None
    chosen = name or state.touched
    covariate = state.atlas.covariates[state.atlas.index(chosen) if chosen else 0]
    (low, high), here = covariate.range, dict(state.named)[covariate.name]
    return Sweep(covariate, (here - low) / (high - low))
