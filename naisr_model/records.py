"""Records: JSON of our own, read back so that every value is of the kind that was written there.

A file that was damaged, or made by hand, is found out here and not by an accident later on. Whoever knows the
file makes a sentence of the :class:`ValueError` that these functions raise.

>>> record = parsed('{"scale_mm": 2, "subjects": ["S1", "S2"]}')
>>> number(record, "scale_mm"), texts(record, "subjects")
(2.0, ('S1', 'S2'))
"""

from __future__ import annotations

import json
from reprlib import repr as shortened
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T", str, int, bool, list, dict)

LARGEST = 1e30
"""Of what may be measured in any unit: its square is still a number, in single precision it is one itself."""

_TITLES: dict[type, str] = {
    str: "a text",
    int: "a whole number",
    bool: "true or false",
    list: "a list",
    dict: "a record",
}


def parsed(text: str) -> dict[str, Any]:
    """The record that a JSON text holds.

    Raises:
        ValueError: when it holds something else.
    """
    try:
        record = json.loads(text)
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error
    except ValueError as error:
        raise ValueError("it is no JSON") from error
    return _of_kind(record, dict, "it")


def entry(record: dict[str, Any], key: str, kind: type[T]) -> T:
    """A value of exactly this kind: true is no whole number here.

    Raises:
        ValueError: when it is missing or of another kind.
    """
    return _of_kind(_present(record, key), kind, f"'{key}'")


def number(record: dict[str, Any], key: str) -> float:
    """A finite number.

    Raises:
        ValueError: when it is missing or something else.
    """
    value = _present(record, key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= LARGEST:
        raise ValueError(f"'{key}' is {shortened(value)}, not a finite number")
    return float(value)


def numbers(record: dict[str, Any], key: str, *shape: int) -> NDArray[np.float64]:
    """An array of finite numbers of this shape.

    Raises:
        ValueError: when it is missing, has another shape or holds something else.
    """
    value = entry(record, key, list)
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"'{key}' is no array of numbers") from error
    if array.shape != shape:
        raise ValueError(f"'{key}' has {size(array.shape)} numbers where {size(shape)} are expected")
    if not (np.abs(array) <= LARGEST).all():
        raise ValueError(f"'{key}' holds what is no finite number")
    return array


def rows(record: dict[str, Any], key: str) -> list[dict[str, Any]]:
    """A list of records.

    Raises:
        ValueError: when it is missing or something else.
    """
    return [_of_kind(value, dict, f"an entry of '{key}'") for value in entry(record, key, list)]


def texts(record: dict[str, Any], key: str) -> tuple[str, ...]:
    """A list of texts.

    Raises:
        ValueError: when it is missing or something else.
    """
    return tuple(_of_kind(value, str, f"an entry of '{key}'") for value in entry(record, key, list))


def flags(record: dict[str, Any], key: str) -> NDArray[np.bool_]:
    """A list of true and false.

    Raises:
        ValueError: when it is missing or something else.
    """
    values = [_of_kind(value, bool, f"an entry of '{key}'") for value in entry(record, key, list)]
    return np.array(values, dtype=bool)


def scalars(record: dict[str, Any], key: str) -> dict[str, Any]:
    """A record of texts, finite numbers, true, false and nothing, without records within.

    Raises:
        ValueError: when it is missing or something else.
    """
    values = entry(record, key, dict)
    for name, value in values.items():
        if not isinstance(value, str | bool | None):
            number(values, name)
    return values


def figures(record: dict[str, Any], key: str) -> dict[str, Any]:
    """A record of numbers; what could not be measured is NaN.

    Raises:
        ValueError: when it is missing or something else.
    """
    values = entry(record, key, dict)
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(f"'{name}' is {shortened(value)}, not a number")
    return values


def size(shape: tuple[int, ...]) -> str:
    """A shape in words: ``3 by 4``."""
    return " by ".join(map(str, shape)) or "a number"


def _present(record: dict[str, Any], key: str) -> Any:
    if key not in record:
        raise ValueError(f"'{key}' is missing")
    return record[key]


def _of_kind(value: Any, kind: type[T], what: str) -> T:
    if type(value) is not kind:
        raise ValueError(f"{what} is {shortened(value)}, not {_TITLES[kind]}")
    return value
