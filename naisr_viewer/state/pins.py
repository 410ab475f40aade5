"""Places that the user has pinned: material points, which are in every shape."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from naisr_viewer.state.layouts import Panel
from naisr_viewer.state.patients import Named

MOST_PINS = 3
"""How many there can be; one more takes the place of the oldest."""

Point = tuple[float, float, float]
"""Millimetres in the frame of the atlas; in the plane z is 0."""


@dataclass(frozen=True)
class Pin:
    """One place.

    Attributes:
        number: tells the pins apart, from 1.
        origin_mm: the material point, by where it is on the template.
    """

    number: int
    origin_mm: Point


@dataclass(frozen=True)
class Shown:
    """One surface in which pins are to be found.

    Attributes:
        panel: where it is shown.
        values: the covariate values (real units) that it depends on.
        person: whose code; 0 for the population average.
    """

    panel: Panel
    values: Named
    person: int


@dataclass(frozen=True)
class LedgerRequest:
    """What is asked about the pins.

    Attributes:
        atlas: the file of the atlas.
        pins: which.
        whole: the surface whose displacements are told, the full shape.
        others: the surfaces beside it in which the pins are marked.
        has_norms: whether the people of the atlas tell how sure its effects are.
    """

    atlas: Path
    pins: tuple[Pin, ...]
    whole: Shown
    others: tuple[Shown, ...]
    has_norms: bool = False


@dataclass(frozen=True)
class Part:
    """What one cause does to a place, in mm.

    Attributes:
        cause: name of a covariate; empty for what sets the person apart, and for the sum.
        normal_mm: along the outward normal of the full shape; all causes' add up to the sum's.
        tangential_mm: length of the rest, along the surface.
        margin_mm: half of the 95 % interval of ``normal_mm``; None where that is not known, as of a person.
    """

    cause: str
    normal_mm: float
    tangential_mm: float
    margin_mm: float | None = None

    @property
    def is_told(self) -> bool:
        """Whether the people of the atlas tell it from nothing, as far as is known."""
        return self.margin_mm is None or abs(self.normal_mm) > self.margin_mm


@dataclass(frozen=True)
class Entry:
    """What moved one pinned place from the template to the full shape.

    Attributes:
        pin: which.
        parts: one a covariate.
        person: what sets the person apart; None for the population average.
        total: the whole way.
    """

    pin: Pin
    parts: tuple[Part, ...]
    person: Part | None
    total: Part


@dataclass(frozen=True)
class Ledger:
    """The answer to a :class:`LedgerRequest`.

    Attributes:
        request: the question.
        entries: one a pin that has a place in the full shape; where the deformation folds there is none.
        places: where the pins are in each surface, by panel; a pin without a place is left out.
    """

    request: LedgerRequest
    entries: tuple[Entry, ...]
    places: tuple[tuple[Panel, tuple[tuple[int, Point], ...]], ...]


def with_pin(pins: tuple[Pin, ...], origin_mm: Point) -> tuple[Pin, ...]:
    """One more pin, with the lowest number that is free; the oldest makes room where there is none."""
    kept = pins[-(MOST_PINS - 1) :] if len(pins) >= MOST_PINS else pins
    free = set(range(1, MOST_PINS + 1)) - {pin.number for pin in kept}
    return (*kept, Pin(min(free), origin_mm))
