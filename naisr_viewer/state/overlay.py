"""What the surfaces of the shape model are coloured by."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum


class Quantity(StrEnum):
    """What is shown of a surface, point by point."""

    PLAIN = "plain"
    DISPLACEMENT = "displacement"
    RATE = "rate"


@dataclass(frozen=True)
class Map:
    """A quantity at each point of one surface.

    Attributes:
        quantity: which; never plain.
        covariate: of a rate, what it is of; empty for a displacement.
    """

    quantity: Quantity
    covariate: str = ""


@dataclass(frozen=True)
class Overlay:
    """What the user has chosen to see on the surfaces.

    Attributes:
        quantity: which.
        limits: ends of colour scales that were moved, by the unit of their numbers, or by their panel where
            each has its own; in that unit.
        is_shared: whether all surfaces with numbers of one unit share its scale.
    """

    quantity: Quantity = Quantity.PLAIN
    limits: tuple[tuple[str, float], ...] = ()
    is_shared: bool = True


NOTHING_SHOWN = Overlay()
"""Plain surfaces."""


def with_limit(overlay: Overlay, key: str, limit: float) -> Overlay:
    """The end of one scale moved."""
    return replace(overlay, limits=tuple(sorted({**dict(overlay.limits), key: limit}.items())))
