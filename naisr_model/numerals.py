"""Numbers as people write them: with a point or a comma, with marks between thousands, with what is wrong.

>>> read_number("12,5")
12.5
>>> read_number("1,234", decimal_marks({"12,5", "1,234"}))
1.234
>>> read_number("1,234")
Traceback (most recent call last):
...
ValueError: , which may be 1.234 or 1234; write it without a mark for thousands
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable

LARGEST = 1e12
"""Nothing that is measured of a person is larger; sums of such numbers and their squares stay finite."""

MISSING = frozenset(
    (
        "",
        ".",
        "?",
        "-",
        "--",
        "–",
        "—",
        "na",
        "n/a",
        "n.a.",
        "nan",
        "nil",
        "none",
        "null",
        "<na>",
        "#n/a",
        "#na",
        "#null!",
        "#value!",
        "#ref!",
        "#div/0!",
        "#name?",
        "#num!",
        "missing",
        "unknown",
        "not available",
    )
)
"""What stands for a value that nobody knows, in small letters."""

IS_MISSING = ", which stands for a missing value; fill it in or drop the row"
"""What is said of such a text."""

_PLAIN = re.compile(r"\d+|\d*[.,]\d+|\d+[.,]\d*", re.ASCII)
_GROUPED = re.compile(r"\d{1,3}(?:(?P<group>[.,'’ \u00a0\u202f])\d{3})(?:(?P=group)\d{3})*", re.ASCII)
_SIGNED = re.compile(r"(?P<sign>[+-]?)(?P<digits>\d.*?|[.,]\d.*?)(?P<power>[eE][+-]?\d{1,4})?", re.ASCII)
_DATE = re.compile(r"\d{4}-\d\d?-\d\d?([ T].*)?|\d\d?[./-]\d\d?[./-](\d\d|\d{4})", re.ASCII)
_WITH_UNIT = re.compile(r"[+-]?[\d.,]*\d\s*(?P<unit>%|°|[^\W\d_][^\d]*)")
_BOUND = re.compile(r"[<>≤≥~≈]=?\s*[\d.,]+.*|[\d.,]+\s*(\+|-|–|to)\s*[\d.,]*", re.ASCII)


def is_missing(text: str) -> bool:
    """Whether a text stands for a value that nobody knows: blank, ``NA``, ``n/a``, ``NaN``, ``-``."""
    return text.strip().casefold() in MISSING


def decimal_marks(texts: Iterable[str]) -> frozenset[str]:
    """Which of ``.`` and ``,`` certainly begin the decimals of some of these numbers."""
    return frozenset(mark for text in texts if (mark := _certain_mark(text)))


def read_number(text: str, marks: Collection[str] = ()) -> float:
    """The number that is meant.

    Args:
        text: with a decimal point or comma; thousands may be parted by commas, points, spaces or ``'``.
        marks: which decimal marks stand in numbers around it, see :func:`decimal_marks`; ``1,234`` is
            1.234 only where they are commas.

    Raises:
        ValueError: with the words that go on after the text in a sentence: what it is, and what to do.
    """
    signed = _SIGNED.fullmatch(_tidy(text))
    value = None if signed is None else _unsigned(signed["digits"], marks)
    if signed is None or value is None:
        raise ValueError(_instead(text.strip()))
    number = float(f"{signed['sign']}{value}{signed['power'] or ''}")
    if abs(number) > LARGEST:
        raise ValueError(", larger than anything that is measured; correct it")
    return number


def _tidy(text: str) -> str:
    return text.strip().replace("−", "-")


def _certain_mark(text: str) -> str:
    """The mark of a number that can be read in one way only; empty where there is none or doubt."""
    signed = _SIGNED.fullmatch(_tidy(text))
    digits = "" if signed is None else signed["digits"]
    mark = max(".,", key=digits.rfind)
    whole, _, rest = digits.rpartition(mark)
    if not rest.isdecimal() and whole != digits[:-1]:
        return ""
    if _PLAIN.fullmatch(digits):
        return "" if mark not in digits or _is_doubtful(digits) else mark
    return mark if _GROUPED.fullmatch(whole) and mark not in whole else ""


def _is_doubtful(digits: str) -> bool:
    """``1,234`` may be a thousand or one; ``0,234`` and ``1234,567`` may not."""
    return _GROUPED.fullmatch(digits) is not None and not digits.startswith("0")


def _unsigned(digits: str, marks: Collection[str]) -> str | None:
    """The digits as Python writes them; None where they are no number."""
    if _PLAIN.fullmatch(digits):
        mark = "," if "," in digits else "."
        if _is_doubtful(digits) and set(marks) != {mark} and (mark == "," or "," in marks):
            point = digits.replace(",", ".")
            raise ValueError(
                f", which may be {point} or {point.replace('.', '')}; write it without a mark for thousands"
            )
        return digits.replace(",", ".")
    if _GROUPED.fullmatch(digits):
        return re.sub(r"\D", "", digits)
    mark = _certain_mark(digits)
    whole, _, rest = digits.rpartition(mark) if mark else ("", "", "")
    return f"{re.sub(r'[^0-9]', '', whole)}.{rest}" if mark else None


def _instead(text: str) -> str:
    if is_missing(text):
        return IS_MISSING
    if _DATE.fullmatch(text):
        return ", a date; give a number, such as an age"
    if _BOUND.fullmatch(text):
        return ", a range; give one number"
    if with_unit := _WITH_UNIT.fullmatch(text):
        unit = with_unit["unit"].strip()
        return f", a number with a unit; leave the number and write [{unit}] into the header"
    return "; expected a number" + (" without _" if "_" in text else "")
