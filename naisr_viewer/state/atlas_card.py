"""What the window knows of an open atlas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from naisr_model.capabilities import Capabilities
from naisr_model.covariates import Covariate, Population, complete, read_values
from naisr_model.files import Stamp
from naisr_model.frames import Frame

RealVector = tuple[float, ...]
"""Real covariate values in the atlas's covariate order."""


@dataclass(frozen=True)
class AtlasCard:
    """All that the window needs to know of an open atlas.

    Attributes:
        path: the file it was read from.
        name: for example ``airway``.
        covariates: the sliders, in order; none where the shape model depends on none.
        population: real values of the subjects behind the atlas, for the histograms.
        capabilities: what its shape model can do; what it cannot do is absent from the window.
        frame: where its shapes are, in which unit of length, and whether in space or in the plane.
        written: of the file, when it was read.
    """

    path: Path
    name: str
    covariates: tuple[Covariate, ...]
    population: Population
    capabilities: Capabilities
    frame: Frame
    written: Stamp = None

    @property
    def is_flat(self) -> bool:
        """Whether its shapes are curves in the plane, which are looked at from the front alone."""
        return self.frame.dim == 2

    @property
    def is_tabulated(self) -> bool:
        """Whether previews are carried by tables; curves are found by the networks in no time."""
        return self.capabilities.trackable and not self.is_flat

    @property
    def start(self) -> RealVector:
        """Where every slider starts: the population mean, halfway between the levels of a binary covariate.

        A model whose shape there is not the template has learned nothing between the levels, where nobody was
        seen: it starts at the first of them.
        """
        return tuple(self._start_of(covariate) for covariate in self.covariates)

    def _start_of(self, covariate: Covariate) -> float:
        is_known = covariate.kind == "continuous" or self.capabilities.vanishes_at_centre
        return covariate.centre if is_known else covariate.range[0]

    def read_values(self, option: str, settings: Sequence[str]) -> dict[str, float]:
        """Real values by name from ``["age=120", "sex=M"]``, which stand behind ``option``.

        Raises:
            InputError: for an unknown covariate, no number, or a value outside the observed range.
        """
        values = read_values(option, settings, self.covariates)
        complete(self.covariates, values)
        return values

    def index(self, name: str) -> int:
        """Position of a covariate; ``ValueError`` for an unknown name."""
        return [covariate.name for covariate in self.covariates].index(name)
