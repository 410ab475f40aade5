"""How values, volumes and errors are put everywhere in the window."""

from __future__ import annotations

import math
import re

from naisr_model.covariates import Covariate, interval_in_words
from naisr_model.errors import InputError
from naisr_model.frames import SPACE, Extent

MILLIMETRES = "mm"

TYPED_DIGITS = 7
"""Numbers that end within so many digits, counted from the last usual one, are shown as they are."""


def written(covariate: Covariate, value: float) -> str:
    """The value as its number box shows it: ``84``, and to the last digit what was typed: ``153.5``.

    What has more digits than anybody types, such as an inferred value, is rounded.
    """
    usual = covariate.decimals
    exact = (digits for digits in range(usual, usual + TYPED_DIGITS) if round(value, digits) == value)
    return f"{value:.{next(exact, usual)}f}"


def reading(covariate: Covariate, value: float) -> str:
    """The value with its unit and as many digits as its range asks for: ``84 months``, ``M``."""
    if covariate.kind == "binary":
        return covariate.format(round(value, 2))
    return f"{value:.{covariate.decimals}f} {covariate.unit}".rstrip()


def given(covariate: Covariate, value: float) -> str:
    """A value that somebody gave, as it was given: ``153.5 months``, ``M``."""
    if covariate.kind == "binary":
        return covariate.format(value)
    return f"{written(covariate, value)} {covariate.unit}".rstrip()


def interval_reading(covariate: Covariate, low: float, high: float) -> str:
    """A 95 % interval: ``95 %: 18.2 to 24.9 kg``; of a binary covariate the levels it leaves open."""
    told = interval_in_words(covariate, low, high, reading)
    if covariate.kind == "binary":
        return "inferred" if low == high else f"inferred; {told}"
    return f"95\u00a0%: {told}"


def length(mm: float, unit: str = MILLIMETRES) -> str:
    """A distance with digits that mean something: ``0.08 mm``, ``13.5 mm``, ``2,314 mm``.

    In another unit, whose size nobody knows, it has three of them: ``0.0123 units``.
    """
    if unit != MILLIMETRES:
        return f"{mm:,.{places(mm, 3)}f} {unit}"
    digits = 2 if abs(mm) < 9.995 else 1 if abs(mm) < 99.95 else 0
    return f"{mm:,.{digits}f} mm"


def way(mm: float, unit: str = MILLIMETRES) -> str:
    """How far something moved, and to which side: ``+2.31 mm``, ``−13.5 mm``, ``0.00 mm``."""
    is_none = round(mm, 2) == 0 if unit == MILLIMETRES else mm == 0
    sign = "" if is_none else "+" if mm > 0 else "−"
    return f"{sign}{length(abs(mm), unit)}"


def in_unit(text: str, unit: str) -> str:
    """Words that speak of millimetres, for an atlas whose unit of length is another one."""
    return text if unit == MILLIMETRES else re.sub(r"\bmm\b", unit, text)


def margin(mm: float, sure_mm: float, unit: str = MILLIMETRES) -> str:
    """How far something moved, and half of the 95 % interval of that: ``+2.31 ± 0.12 mm``."""
    return f"{way(mm, unit).removesuffix(f' {unit}')} ± {length(sure_mm, unit)}"


def duration(seconds: float) -> str:
    """``0.49 s``, ``4.2 s``, ``132 s``."""
    digits = 2 if seconds < 0.995 else 1 if seconds < 9.95 else 0
    return f"{seconds:,.{digits}f} s"


def patient_reading(covariate: Covariate, value: float, interval: tuple[float, float] | None) -> str:
    """The patient's value in words: ``patient 21.3 kg, 95 %: 18.2 to 24.9 kg``."""
    text = f"patient {reading(covariate, value)}"
    if interval is None:
        return text
    return f"{text}, {interval_reading(covariate, *interval)}"


def mean_reading(covariate: Covariate) -> str:
    """The population mean in words; halfway between the levels of a binary covariate."""
    return "in the middle" if covariate.kind == "binary" else reading(covariate, covariate.centre)


def volume(amount: float, margin: float | None = None, extent: Extent = SPACE) -> str:
    """A volume with digits that mean something: ``48.3 cm³``, ``61.2 ± 7.0 cm³``, ``69,100 ± 5,900 cm³``.

    Beside a margin it ends with the margin's second digit. An area, ``1.447 units²``, has four digits.
    """
    if not margin or not math.isfinite(margin):
        return f"{amount:,.{_decimals(amount, extent)}f} {extent.unit}"
    digits = 1 - math.floor(math.log10(margin))
    places = max(0, digits)
    return f"{round(amount, digits):,.{places}f} ± {round(margin, digits):,.{places}f} {extent.unit}"


def gained(amount: float, before: float, margin: float | None = None, extent: Extent = SPACE) -> str:
    """A difference of volumes: ``+12.7 cm³ (+26 %)``, ``+0.71 cm³ (+2.1 %)``.

    It has no more digits than the margin of the later volume allows; a small one of two volumes that were
    measured has two.
    """
    difference = amount - before
    digits = _decimals(before, extent)
    if extent is SPACE and before < 1000 and abs(difference) < 1:
        digits = 2
    if margin:
        digits = min(digits, 1 - math.floor(math.log10(margin)))
    percent = 100 * difference / before if before else 0.0
    share = f" ({percent:+.{1 if abs(percent) < 9.5 else 0}f}\u00a0%)" if before else ""
    # Adding 0 leaves no minus before nothing.
    told = f"{round(difference, digits) + 0.0:+,.{max(0, digits)}f} {extent.unit}{share}"
    return told.replace("-", "−")


def _decimals(amount: float, extent: Extent) -> int:
    """Of a volume in cm³ one or none; of an area as many as make four digits."""
    if extent is SPACE:
        return 0 if abs(amount) >= 1000 else 1
    return places(amount, 4)


def places(number: float, digits: int) -> int:
    """How many decimals show so many digits of a number."""
    return max(0, digits - 1 - math.floor(math.log10(abs(number)))) if number else 0


def capitalised(text: str) -> str:
    """``text`` with a capital letter in front, unless it begins with a name such as ``p01.stl``."""
    return text[:1].upper() + text[1:] if text.split(" ", 1)[0].isalpha() else text


def in_words(error: BaseException) -> str:
    """An error as the user reads it."""
    if isinstance(error, InputError):
        text = capitalised(str(error))
        return text if text.endswith(".") else f"{text}."
    told = f"{type(error).__name__}: {error}".removesuffix(": ")
    return f"Something unexpected went wrong ({told}). What is on screen is unchanged."
