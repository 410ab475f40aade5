"""What is said of maps: their units, and what their colours mean."""

from __future__ import annotations

import html
from collections.abc import Sequence

from naisr_model.covariates import Covariate
from naisr_viewer.state.overlay import Quantity
from naisr_viewer.words.numbers import MILLIMETRES
from naisr_viewer.words.titles import label

TITLES = {Quantity.PLAIN: "Plain", Quantity.DISPLACEMENT: "mm", Quantity.RATE: "mm per unit"}
"""What the choices are called."""

HINTS = {
    Quantity.PLAIN: "Each surface in its own colour.",
    Quantity.DISPLACEMENT: (
        "How far each point has come from the template along the surface's normal, in mm: orange outwards "
        "(+), blue inwards (−). An effect shows what its covariate does alone, the full shape what all do "
        "together."
    ),
    Quantity.RATE: (
        "How fast each point moves outwards with a covariate, in mm per month, per kg, …; of a binary one, "
        "how much farther out it is at the second level than at the first. On the full shape that is the "
        "covariate that was moved last."
    ),
}
"""What each choice shows."""


MUTE = "Leave {covariate} out of the full shape"
PLAY = "Move {covariate} to and fro by itself"
SOLO = "Only {covariate} in the full shape"
"""What the switches of a covariate do."""

SHARED = "One scale"
SHARED_HINT = (
    "All surfaces with numbers of one unit share its colour scale. Drag an end of a scale to move it; a "
    "double-click fits it to what is shown."
)


def rate_unit(covariate: Covariate, unit: str = MILLIMETRES) -> str:
    """Lengths per unit of a covariate: ``mm per month``, ``mm, M against F``."""
    if covariate.kind == "binary":
        return f"{unit}, {covariate.levels[1]} against {covariate.levels[0]}"
    return f"{unit} per {_one(covariate.unit) or 'unit'}"


def told(covariate: Covariate | None, unit: str = MILLIMETRES) -> str:
    """What the numbers on the full shape are of; empty where they are of all covariates."""
    return "" if covariate is None else f"Full shape: {label(covariate.name)}, {rate_unit(covariate, unit)}"


def without(names: Sequence[str]) -> str:
    """Which covariates are left out: ``without Age and Sex``."""
    titles = [html.escape(label(name), quote=False) for name in names]
    return f"without {' and '.join(filter(None, (', '.join(titles[:-1]), titles[-1])))}"


def _one(unit: str) -> str:
    """``months`` is one ``month``; ``kg`` and ``mmHg`` are as they are."""
    return unit[:-1] if len(unit) > 3 and unit.endswith("s") else unit
