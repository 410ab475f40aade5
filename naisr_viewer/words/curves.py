"""Measures, and what is usual, in words."""

from __future__ import annotations

from naisr_model.covariates import Covariate
from naisr_viewer.state.curves import Curves, MeasureCurve, Reckoning, Standing, readout
from naisr_viewer.words.numbers import places, reading
from naisr_viewer.words.titles import label

METRIC = ("mm", "mm²", "cm²", "cm³")
LAST_MOVED = "moved last"
HINT = (
    "Line: the population's shape, the other covariates as they are\n"
    "Dark: where that line is with a probability of 95 %, as far as the people behind the atlas tell\n"
    "Pale: what 95 % of people have at these covariates\n"
    "Dashed: the others growing along, as in the population\n"
    "Dots: the shapes behind the atlas, each at its own covariates\n"
    "In the patient's colour: the dot as seen, with its 95 % interval; the line on other days\n"
    "Upright: what is on screen; drag it, click elsewhere or press the arrow keys"
)
MEASURING = "Measuring …"
NOT_KNOWN = "95 % of people: not worked out"


def figure(value: float, unit: str) -> str:
    """A measure with digits that mean something: ``46.2 cm³``, ``69,100 cm³``, ``1.447 units²``."""
    return f"{_number(value, unit)} {unit}".rstrip()


def axis(curve: MeasureCurve) -> str:
    """What stands at the axis of a measure."""
    return f"{curve.title}, {curve.unit}"


def hint(curve: MeasureCurve) -> str:
    """What a measure is, for who hovers over it."""
    return f"{curve.title} in {curve.unit}: {curve.definition}"


def told(covariate: Covariate, curves: Curves, curve: MeasureCurve, place: float) -> str:
    """What there is at a place along a curve, a line each: the population, its people, the patient."""
    usual, sure, band, own = readout(curves, curve, place)
    lines = [f"{label(covariate.name)} {reading(covariate, place)}: {figure(usual, curve.unit)}"]
    if sure is not None:
        lines.append(f"95 % sure: {_ends(*sure, curve.unit)}")
    if band is not None:
        lines.append(f"95 % of people: {_ends(*band, curve.unit)}")
    if own is not None:
        lines.append(f"This patient: {figure(own, curve.unit)}")
    return "\n".join(lines)


def reckoned(now: Reckoning) -> str:
    """How far it is known what is usual; empty where there is nothing to say."""
    if now.share is not None:
        return f"95 % of people: {100 * now.share:.0f} % done"
    return now.trouble or (NOT_KNOWN if now.can_begin else "")


def rank(standing: Standing) -> str:
    """Where a patient stands among people: ``73rd percentile (z +0.6)``."""
    z = f"{standing.z:+.1f}".replace("-", "−")
    return f"{_percentile(standing.percentile)} (z {z})"


def standing_hint(standing: Standing) -> str:
    """What a measure of a patient is compared with, for who hovers over it."""
    usual = _ends(standing.low, standing.high, standing.unit)
    return (
        f"{standing.title} in {standing.unit}: {standing.definition}.\n"
        f"95 % of people of the same covariates have {usual} {standing.unit}. "
        "The percentile is the share of them that have less; z is how many standard deviations the patient "
        "lies above their median."
    )


def _ends(low: float, high: float, unit: str) -> str:
    """An interval without its unit."""
    return " to ".join(_number(end, unit) for end in (low, high))


def _number(value: float, unit: str) -> str:
    """Of a unit whose size nobody knows, four digits."""
    if unit not in METRIC:
        return f"{value:,.{places(value, 4)}f}"
    return f"{value:,.{0 if abs(value) >= 1000 else 1}f}"


def _percentile(share: float) -> str:
    if share < 1:
        return "below the 1st percentile"
    if share > 99:
        return "above the 99th percentile"
    number = round(share)
    is_teen = 10 <= number % 100 <= 20
    return f"{number}{'th' if is_teen else {1: 'st', 2: 'nd', 3: 'rd'}.get(number % 10, 'th')} percentile"
