"""What a column of a table means: a number or two levels, what is wrong in it, and what looks wrong.

Everything that is guessed is told, so that a person can say otherwise in the TOML beside the table.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from naisr_model.covariates import Covariate
from naisr_model.data.remarks import Remark
from naisr_model.data.sheets import numbered
from naisr_model.errors import InputError
from naisr_model.numerals import IS_MISSING, decimal_marks, is_missing, read_number

SPELLINGS = (
    (
        ("f", "fem", "female", "femme", "féminin", "femenino", "girl", "mujer", "w", "weiblich", "woman"),
        ("m", "male", "homme", "masculin", "masculino", "boy", "hombre", "man", "mann", "männlich"),
    ),
    (("n", "no", "f", "false", "nein", "non"), ("y", "yes", "t", "true", "j", "ja", "oui", "si", "sí")),
    (("l", "left"), ("r", "right")),
    (("-", "neg", "negative"), ("+", "pos", "positive")),
)
"""Words for the same two levels, in small letters."""

MISSING_CODES = (-1, -9, -77, -88, -99, -999, -9999, 9, 77, 88, 99, 777, 888, 999, 7777, 8888, 9999, 99999)
"""Numbers that questionnaires and databases write for a value that nobody knows."""

SURELY_BELOW, SURELY_TIMES = -9, 3.0
"""Such a number is almost surely a code where all others are positive: up to the first, or beyond so many
times the largest of them."""

USUAL_PAIRS = ((0.0, 1.0), (1.0, 2.0), (-1.0, 1.0))
"""Pairs of numbers that are codes for two levels and hardly ever measurements."""

FAR_APART = 10.0
"""Median absolute deviations (as standard deviations) beyond which a value is far from the others."""

FEW_CODES = 6
"""Up to so many whole numbers without a unit, over and over again, may be codes for categories."""


class Fault(NamedTuple):
    """A cell that cannot be used; ``what`` goes on after its text. ``row`` is 0 for a whole column."""

    row: int
    column: str
    cell: str
    what: str


@dataclass(frozen=True)
class Column:
    """A covariate as it stands in the table.

    Attributes:
        name: without the unit.
        unit: as the header or the TOML has it; empty where none is given.
        settings: what the TOML says of it.
        rows: line numbers.
        cells: the text in each of them.
    """

    name: str
    unit: str
    settings: Mapping[str, Any]
    rows: tuple[int, ...]
    cells: tuple[str, ...]

    def take(self, chosen: NDArray[np.bool_]) -> Column:
        """The column with only some of its rows."""
        rows, cells = (tuple(np.array(each)[chosen].tolist()) for each in (self.rows, self.cells))
        return replace(self, rows=rows, cells=cells)


@dataclass(frozen=True, eq=False)
class Understood:
    """A covariate as it was understood.

    Attributes:
        covariate: centre and scale are still 0 and 1.
        values: real units, -1/+1 of a binary covariate, ``[n]``; NaN in cells with a fault or a code.
        faults: what cannot be used.
        remarks: what looks wrong, or was taken as the same.
        told: what it was taken for, as ``age [months]: a number from 1 to 233``.
        codes: by row what is almost surely a code for a missing value, and refuses the row.
    """

    covariate: Covariate
    values: NDArray[np.float64]
    faults: tuple[Fault, ...]
    remarks: tuple[Remark, ...]
    told: str
    codes: Mapping[int, Remark] = field(default_factory=dict)


def read_column(
    column: Column, sheet_marks: Collection[str], accepted: Collection[int] = frozenset()
) -> Understood:
    """Understand a covariate.

    Args:
        column: its cells.
        sheet_marks: the decimal marks in the whole table, for a column whose own do not tell.
        accepted: rows whose value is meant, even where it looks like a code for a missing one.
    """
    marks = decimal_marks(column.cells) or sheet_marks
    values = np.array([_number_or_nan(cell, marks) for cell in column.cells])
    codes = [] if column.settings.keys() & {"levels"} else _sure_codes(values[~np.isnan(values)])
    coded = np.isin(values, codes) & ~np.isin(column.rows, list(accepted))
    if not coded.any():
        return _understood(column, marks, values.tolist())
    understood = _understood(column.take(~coded), marks, values[~coded].tolist())
    others = _range(values[~np.isnan(values) & ~np.isin(values, codes)])
    all_values = np.full(len(values), math.nan)
    all_values[~coded] = understood.values
    told = [_coded(column, coded & (values == code), code, others) for code in codes]
    return replace(
        understood,
        values=all_values,
        remarks=(*(remark for remark in told if remark), *understood.remarks),
        codes={
            row: _code(column.name, value, others)
            for row, value, one in zip(column.rows, values.tolist(), coded, strict=True)
            if one
        },
    )


def _understood(column: Column, marks: Collection[str], numbers: Sequence[float]) -> Understood:
    kind = column.settings.get("kind", "binary" if "levels" in column.settings else _guess(column, numbers))
    return _continuous(column, marks) if kind == "continuous" else _binary(column, numbers)


def _number_or_nan(cell: str, marks: Collection[str]) -> float:
    try:
        return read_number(cell, marks)
    except ValueError:
        return math.nan


def _guess(column: Column, numbers: Sequence[float]) -> str:
    """Two distinct numbers without a unit, or words: levels; anything else is measured."""
    found = {number for number in numbers if not math.isnan(number)}
    words = [
        cell
        for cell, number in zip(column.cells, numbers, strict=True)
        if math.isnan(number) and not is_missing(cell)
    ]
    if not found:
        return "binary"
    if not words:
        return "binary" if len(found) == 2 and not column.unit else "continuous"
    # A stray number among words, or a stray word among numbers.
    return "binary" if len(words) > len(numbers) / 2 and len(_groups(words)) == 2 else "continuous"


# --- measured ----------------------------------------------------------------------------------


def _continuous(column: Column, marks: Collection[str]) -> Understood:
    values, faults = np.full(len(column.cells), math.nan), []
    for i, (row, cell) in enumerate(zip(column.rows, column.cells, strict=True)):
        try:
            values[i] = read_number(cell, marks)
        except ValueError as error:
            faults.append(Fault(row, column.name, cell, str(error)))
    good = values[~np.isnan(values)]
    faults += _unvaried(column, good)
    low, high = (float(good.min()), float(good.max())) if len(good) else (0.0, 0.0)
    covariate = Covariate(column.name, column.unit, "continuous", 0.0, 1.0, (low, high))
    told = f"{_title(column)}: a number from {low:g} to {high:g}, median {_median(good):.4g}"
    remarks = () if faults else _doubts(column, values)
    return Understood(covariate, values, tuple(faults), remarks, told)


def _unvaried(column: Column, values: NDArray[np.float64]) -> list[Fault]:
    """The fault of a column that says nothing."""
    if len(values) < len(column.cells) or values.min() != values.max():
        return []
    return [Fault(0, column.name, column.cells[0], " in every row; remove the column")]


def _median(values: NDArray[np.float64]) -> float:
    return float(np.median(values)) if len(values) else math.nan


def _title(column: Column) -> str:
    return f"{column.name} [{column.unit}]" if column.unit else column.name


def _doubts(column: Column, values: NDArray[np.float64]) -> tuple[Remark, ...]:
    """What looks wrong in numbers that can all be read."""
    codes = _missing_codes(values)
    rest = values[~np.isin(values, codes)]
    far = np.array([value for value in np.unique(rest) if _is_far(value, rest)])
    found = [_strayed(column, values, value) for value in far[:5]]
    found += [_suspected(column, values, code) for code in codes]
    if _look_like_categories(column, rest):
        found.append(_categories(column, rest))
    if len(np.unique(values)) == 2 and "kind" not in column.settings:
        found.append(_two_valued(column, values, "a number", 'kind = "binary"'))
    return tuple(found)


def _sure_codes(values: NDArray[np.float64]) -> list[float]:
    """Those of :func:`_missing_codes` that are hardly ever a value."""
    codes = _missing_codes(values)
    rest = values[~np.isin(values, codes)]
    return [code for code in codes if code <= SURELY_BELOW or code > SURELY_TIMES * rest.max()]


def _missing_codes(values: NDArray[np.float64]) -> list[float]:
    """Which of the usual codes for a missing value are there, and stand apart from the others."""
    there = [float(code) for code in MISSING_CODES if (values == code).any()]
    rest = values[~np.isin(values, there)]
    if not len(rest):
        return []
    whole = bool((rest == np.round(rest)).all())
    apart = [code for code in there if _stands_apart(code, rest, whole)]
    if (values == 0).any() and _is_odd_zero(rest[rest != 0]):
        apart.append(0.0)
    return apart


def _is_odd_zero(rest: NDArray[np.float64]) -> bool:
    """Whether 0 lies far below values that are all positive and lie close together."""
    distinct = np.unique(rest)
    if len(distinct) < FEW_CODES or distinct[0] <= 0:
        return False
    return bool(distinct[0] > max(0.25 * np.median(rest), 5 * np.median(np.diff(distinct))))


def _stands_apart(code: float, rest: NDArray[np.float64], whole: bool) -> bool:
    if code < 0:
        return bool(rest.min() >= 0)
    return bool(code > 1.5 * rest.max() > 0) and (whole or code > 9)


def _is_far(value: float, values: NDArray[np.float64]) -> bool:
    """Beyond :data:`FAR_APART`, or several times the largest of the others."""
    others = values[values != value]
    if len(others) < 3:
        return False
    middle = np.median(others)
    spread = 1.4826 * float(np.median(np.abs(others - middle)))
    beyond = spread > 0 and len(others) > 6 and abs(value - middle) > FAR_APART * spread
    return bool(beyond or abs(value) > 5 * np.abs(others).max() > 0)


def _suspected(column: Column, values: NDArray[np.float64], code: float) -> Remark:
    sentence = f"{_apart(column, values, code)}, and otherwise {_range(values[values != code])}"
    return Remark("look", "missing", sentence, "if that stands for a missing value, drop the row")


def _coded(column: Column, chosen: NDArray[np.bool_], code: float, others: str) -> Remark | None:
    """On a column whose cells hold a code; None where none does."""
    if not chosen.any():
        return None
    sentence = f"'{column.name}' is {code:g} in {_where(column, chosen)}, and otherwise {others}"
    remedy = (
        "that stands for a missing value, so the row is left out unless --accept ROW says that it is meant"
    )
    return Remark("refuse", "missing", sentence, remedy)


def _code(name: str, code: float, others: str) -> Remark:
    """On a row."""
    sentence = f"'{name}' is {code:g} and otherwise {others}, so it stands for a missing value"
    return Remark("refuse", "missing", sentence, "correct it")


def _strayed(column: Column, values: NDArray[np.float64], value: float) -> Remark:
    others = _range(values[values != value])
    sentence = f"{_apart(column, values, value)}, far from the others, which are {others}"
    return Remark("look", "outlier", sentence, "look for a slip of the pen or another unit")


def _apart(column: Column, values: NDArray[np.float64], value: float) -> str:
    return f"'{column.name}' is {value:g} in {_where(column, values == value)}"


def _range(values: NDArray[np.float64]) -> str:
    return f"{values.min():g} to {values.max():g}"


def _look_like_categories(column: Column, values: NDArray[np.float64]) -> bool:
    distinct, counts = np.unique(values, return_counts=True)
    return bool(
        not column.unit
        and "kind" not in column.settings
        and 2 <= len(distinct) <= FEW_CODES
        and (len(distinct) > 2 or len(np.unique(column.cells)) > 2)
        and counts.max() > 1
        and (distinct == np.round(distinct)).all()
        and distinct.min() >= 0
        and distinct.max() < 20
    )


def _categories(column: Column, values: NDArray[np.float64]) -> Remark:
    listed = ", ".join(f"{value:g}" for value in np.unique(values))
    sentence = f"'{column.name}' has only the values {listed} and was read as a number"
    return Remark(
        "look", "kind", sentence, "if they are categories, make a column of 0 and 1 of each but one"
    )


def _two_valued(column: Column, values: NDArray[np.float64], read_as: str, other: str) -> Remark:
    low, high = np.unique(values)
    sentence = f"'{column.name}' has only the values {low:g} and {high:g} and was read as {read_as}"
    return Remark("look", "kind", sentence, f"if that is wrong, write {other} for it into the TOML")


def _where(column: Column, chosen: NDArray[np.bool_]) -> str:
    return numbered([row for row, one in zip(column.rows, chosen, strict=True) if one])


# --- two levels --------------------------------------------------------------------------------


def _binary(column: Column, numbers: Sequence[float]) -> Understood:
    if "levels" in column.settings:
        levels = tuple(map(str, column.settings["levels"]))
        keys = [_matched(cell, number, levels) for cell, number in zip(column.cells, numbers, strict=True)]
    else:
        levels, keys = _found_levels(column.cells, numbers)
    faults = _level_faults(column, levels, keys)
    if len(levels) != 2 or len(set(levels)) != 2:
        levels = ("-1", "+1")
    minus, plus = levels
    values = np.array([{minus: -1.0, plus: 1.0}.get(key, math.nan) for key in keys])
    if not faults:
        faults += _unvaried(column, values)
    covariate = Covariate(column.name, column.unit, "binary", 0.0, 1.0, (-1.0, 1.0), (minus, plus))
    counts = [sum(key == level for key in keys) for level in levels]
    told = f"{_title(column)}: {minus} in {_rows(counts[0])}, {plus} in {_rows(counts[1])}"
    remarks = () if faults else _level_remarks(column, levels, keys, numbers)
    return Understood(covariate, values, tuple(faults), remarks, told)


def _rows(count: int) -> str:
    return f"{count} row{'s' * (count != 1)}"


def _found_levels(cells: Sequence[str], numbers: Sequence[float]) -> tuple[tuple[str, ...], list[str]]:
    """The names of the levels in order, and which of them each cell is; empty for a missing value."""
    plus_minus = {cell for cell in cells if cell} == {"+", "-"}
    words = [cell for cell in cells if plus_minus or not is_missing(cell)]
    groups = _groups(words)
    names = {word: _name(group) for group in groups for word in group}
    if not any(map(math.isnan, numbers)):
        order = sorted({names[cell] for cell in cells}, key=lambda name: numbers[_first(cells, names, name)])
        return tuple(order), [names[cell] for cell in cells]
    return tuple(sorted(set(names.values()))), [names.get(cell, "") for cell in cells]


def _first(cells: Sequence[str], names: Mapping[str, str], name: str) -> int:
    return next(i for i, cell in enumerate(cells) if names[cell] == name)


def _groups(words: Iterable[str]) -> list[Counter[str]]:
    """Spellings of the same level, each with how often it occurs."""
    counts = Counter(words)
    family = next((pair for pair in SPELLINGS if all(w.casefold() in pair[0] + pair[1] for w in counts)), ())
    groups: dict[str | float, Counter[str]] = {}
    for word, count in counts.items():
        groups.setdefault(_meaning(word, family), Counter())[word] = count
    return list(groups.values())


def _meaning(word: str, family: Sequence[Sequence[str]]) -> str | float:
    folded = word.casefold()
    number = _number_or_nan(word, ())
    if not math.isnan(number):
        return number
    return next((words[0] for words in family if folded in words), folded)


def _name(group: Counter[str]) -> str:
    """The most frequent spelling; of equally frequent ones the shortest."""
    return min(group, key=lambda word: (-group[word], len(word), word))


def _matched(cell: str, number: float, levels: Sequence[str]) -> str:
    """The level that a cell names, spelled exactly or otherwise; empty for none."""
    if cell in levels:
        return cell
    families = [next((pair for pair in SPELLINGS if _in_pair(cell, level, pair)), ()) for level in levels]
    same = [
        level
        for level, family in zip(levels, families, strict=True)
        if _meaning(level, family) == (_meaning(cell, family) if math.isnan(number) else number)
    ]
    return same[0] if len(same) == 1 else ""


def _in_pair(cell: str, level: str, pair: Sequence[Sequence[str]]) -> bool:
    return any(cell.casefold() in words and level.casefold() in words for words in pair)


def _level_faults(column: Column, levels: Sequence[str], keys: list[str]) -> list[Fault]:
    if len(levels) != 2 or len(set(levels)) != 2:
        return [Fault(0, column.name, "", _not_two(column, levels, keys))]
    expected = f"; expected {levels[0]} or {levels[1]}"
    return [
        Fault(row, column.name, cell, IS_MISSING if is_missing(cell) else expected)
        for row, cell, key in zip(column.rows, column.cells, keys, strict=True)
        if not key
    ]


def _not_two(column: Column, levels: Sequence[str], keys: list[str]) -> str:
    shown = ", ".join(levels[:4]) + (", ..." if len(levels) > 4 else "")
    count = f"it has {len(levels)}{': ' * bool(levels)}{shown}"
    return f"binary covariate '{column.name}' must have two values; {count}; {_second(column, levels, keys)}"


def _second(column: Column, levels: Sequence[str], keys: list[str]) -> str:
    """What to do about one level, or about three."""
    blank = sorted({cell for cell, key in zip(column.cells, keys, strict=True) if cell and not key})
    if len(levels) < 2 and blank:
        both = ", ".join(f'"{level}"' for level in (blank[0], *levels))
        return (
            f"{blank[0]} counts as a missing value, so write levels = [{both}] into the TOML if it is a level"
        )
    if len(levels) < 2:
        return "remove the column"
    rarest = min(levels, key=lambda level: (keys.count(level), level))
    where = [row for row, key in zip(column.rows, keys, strict=True) if key == rarest]
    rare = f"{rarest} is in {numbered(where)}; " if where else ""
    return f"{rare}spell them alike, make a column of 0 and 1 of each but one, or remove the column"


def _level_remarks(
    column: Column, levels: Sequence[str], keys: Sequence[str], numbers: Sequence[float]
) -> tuple[Remark, ...]:
    remarks = []
    for level in levels:
        others = {cell for cell, key in zip(column.cells, keys, strict=True) if key == level} - {level}
        if others:
            sentence = f"'{column.name}': {', '.join(sorted(others))} was read as {level}"
            remarks.append(Remark("fine", "levels", sentence))
    values = np.unique(numbers)
    guessed = "kind" not in column.settings and "levels" not in column.settings
    if guessed and not np.isnan(values).any() and tuple(values) not in USUAL_PAIRS:
        remarks.append(_two_valued(column, values, "two levels", 'kind = "continuous"'))
    return tuple(remarks)


# --- what is said of faults --------------------------------------------------------------------


def refuse(file: str, faults: Sequence[Fault]) -> None:
    """Say all that cannot be used at once.

    Raises:
        InputError: when there are faults.
    """
    if not faults:
        return
    if len(faults) == 1:
        raise InputError(_alone(file, faults[0]))
    groups: dict[tuple[str, str], list[Fault]] = {}
    for fault in faults:
        groups.setdefault((fault.column, fault.what if fault.row else fault.what + fault.cell), []).append(
            fault
        )
    told = [_together(file, group) for group in groups.values()]
    rest = f"; and {len(told) - MOST_GROUPS} more kinds of trouble" if len(told) > MOST_GROUPS else ""
    raise InputError(f"{file} cannot be used as it is: {'; '.join(told[:MOST_GROUPS])}{rest}")


MOST_GROUPS = 12


def _alone(file: str, fault: Fault) -> str:
    if fault.row:
        return f"{file} row {fault.row}, column '{fault.column}' is {_shown(fault)}"
    return _together(file, [fault])


def _shown(fault: Fault) -> str:
    return f"'{fault.cell}'{fault.what}" if fault.cell else "empty; fill it in or drop the row"


def _together(file: str, group: Sequence[Fault]) -> str:
    """One clause for what is wrong in one column in one way, with all its rows."""
    first = group[0]
    if not first.row:
        return f"column '{first.column}' of {file} is {first.cell}{first.what}" if first.cell else first.what
    cells: dict[str, list[int]] = {}
    for fault in group:
        cells.setdefault(fault.cell, []).append(fault.row)
    listed = [f"{f'{cell!r}' if cell else 'empty'} in {numbered(rows)}" for cell, rows in cells.items()]
    more = f" and {len(listed) - 5} more" if len(listed) > 5 else ""
    what = first.what if first.cell else "; fill it in or drop the row"
    return f"column '{first.column}' is {', '.join(listed[:5])}{more}{what}"
