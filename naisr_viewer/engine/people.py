"""Who was fitted to an open atlas."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from naisr_viewer.state.patients import Named, Scan

if TYPE_CHECKING:
    from naisr_model.atlas import Atlas, Fit, Individual


@dataclass(frozen=True, eq=False)
class FittedPerson:
    """Someone an open atlas was fitted to.

    Attributes:
        atlas: its file.
        fit: what was found.
        scan: the measured shape.
    """

    atlas: Path
    fit: Fit
    scan: Scan

    def at(self, values: Named) -> Individual:
        """The person at these covariates, the others at the population centre."""
        centre = {covariate.name: covariate.centre for covariate in self.fit.individual.atlas.covariates}
        return self.fit.at(centre | dict(values))

    @property
    def atlas_model(self) -> Atlas:
        """The atlas itself."""
        return self.fit.individual.atlas
