"""The vocabulary of a population: what was measured of each shape, in real units.

A model never sees months or kilograms: :meth:`Covariate.normalise` maps a real value to the
centred number ``c_i`` of the paper, where 0 is the population centre.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, cast, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from naisr_model import records
from naisr_model.errors import InputError
from naisr_model.numerals import read_number

Kind = Literal["continuous", "binary"]
KINDS: tuple[Kind, ...] = get_args(Kind)
Values = Mapping[str, float]
"""Covariate values in real units by name; for a binary covariate -1 ... +1."""

BANDWIDTH = 0.3
"""Of the kernel that makes the growth path, in standard deviations of the covariate that moves."""

PRINTED_DIGITS = 4
"""Of a value for people, unless the digits after the point say enough: :attr:`Covariate.decimals`."""

RANGE_SLACK = 1e-9
"""Real units that a value may be out of range at least: to model units and back costs the last digits."""

SCALES = 1e6
"""A range spans fewer standard deviations of what was observed in it."""

EDGE_OF_DATA = 0.98
"""A combination lonelier than this share of the population is where there are no data."""

NEIGHBOURS = 3
"""How many shapes must be near a combination for it to be among the data."""

AT_ONCE = 256
"""Places that are compared with all rows at a time: their distances stay in the processor's cache."""

LEAST_PEOPLE = 10
"""From the shapes of fewer nothing is said of what is usual."""

LEAST_SPREAD = 0.05
"""Combinations closer than this (standard deviations) to a shape are always among the data."""


@dataclass(frozen=True)
class Covariate:
    """One measured property of a subject.

    Attributes:
        name: as in the CSV header, for example ``age``.
        unit: unit of the real value, for example ``months``; empty where there is none.
        kind: ``continuous``, or ``binary`` (then the real value is -1 or +1).
        centre: real value at which ``c_i = 0``: the training mean, 0 for a binary covariate.
        scale: real units per model unit: the training standard deviation, 1 for a binary one.
        range: smallest and largest observed real value.
        levels: names of -1 and +1 for a binary covariate, for example ``("F", "M")``.
    """

    name: str
    unit: str
    kind: Kind
    centre: float
    scale: float
    range: tuple[float, float]
    levels: tuple[str, str] = ("-1", "+1")

    def normalise(self, value: ArrayLike) -> NDArray[np.float64]:
        """Real units to the centred ``c_i``; any shape."""
        return (np.asarray(value, dtype=np.float64) - self.centre) / self.scale

    def restore(self, normalised: ArrayLike) -> NDArray[np.float64]:
        """The inverse of :meth:`normalise`."""
        return np.asarray(normalised, dtype=np.float64) * self.scale + self.centre

    @property
    def decimals(self) -> int:
        """Digits after the point that tell about a thousand steps of the range apart, at most 6."""
        low, high = self.range
        return max(0, min(6, 2 - math.floor(math.log10(max(high - low, 1e-6)))))

    def contains(self, value: float) -> bool:
        """Whether a real value is in the observed range, of which the ends as they are printed are part."""
        low, high = self.range
        return low - self._rounding(low) <= value <= high + self._rounding(high)

    def _rounding(self, end: float) -> float:
        """How far a printed end of the range may be from the true one."""
        digits = 10.0 ** (math.floor(math.log10(abs(end))) + 1 - PRINTED_DIGITS) if end else 0.0
        return max(RANGE_SLACK, digits / 2, 10.0**-self.decimals / 2)

    def parse(self, text: str) -> float:
        """Read ``text`` as a real value: a number, or the name of a level.

        Raises:
            InputError: when ``text`` is neither.
        """
        text = text.strip()
        if self.kind == "binary" and (named := self._named(text)):
            return (-1.0, 1.0)[self.levels.index(named)]
        try:
            value = read_number(text)
        except ValueError as error:
            doubt = str(error) if str(error).startswith(", which may be") else f"; expected {self.expected}"
            raise InputError(f"covariate '{self.name}' is '{text}'{doubt}") from error
        return value

    def _named(self, text: str) -> str:
        """The level that is meant, in small letters or large ones; empty for none."""
        folded = [level for level in self.levels if level.casefold() == text.casefold()]
        return text if text in self.levels else folded[0] if len(folded) == 1 else ""

    def format(self, value: float) -> str:
        """The value as people write it, with its unit: ``120 months``, ``M``, ``halfway between F and M``."""
        if self.kind == "binary":
            if abs(value) == 1:
                return self.levels[int(value > 0)]
            return _in_between(self.levels, value)
        return f"{value:.{PRINTED_DIGITS}g} {self.unit}".rstrip()

    @property
    def extent(self) -> str:
        """The observed range as people write it: ``1 to 233 months``, ``F or M``; both ends can be given."""
        if self.kind == "binary":
            return " or ".join(self.levels)
        low, high = (round(end, self.decimals) for end in self.range)
        return f"{low:.10g} to {high:.10g} {self.unit}".rstrip()

    @property
    def expected(self) -> str:
        """What :meth:`parse` reads: ``a number in months``, ``F or M``."""
        if self.kind == "binary":
            return " or ".join(self.levels)
        return f"a number in {self.unit}" if self.unit else "a number"

    def to_json(self) -> dict[str, Any]:
        """A plain dictionary that :meth:`from_json` reads back."""
        return {
            "name": self.name,
            "unit": self.unit,
            "kind": self.kind,
            "centre": self.centre,
            "scale": self.scale,
            "range": list(self.range),
            "levels": list(self.levels),
        }

    @classmethod
    def from_json(cls, record: dict[str, Any]) -> Covariate:
        """The inverse of :meth:`to_json`.

        Raises:
            ValueError: for what that never gives.
        """
        low, high = map(float, records.numbers(record, "range", 2))
        covariate = cls(
            name=records.entry(record, "name", str),
            unit=records.entry(record, "unit", str),
            kind=cast(Kind, records.entry(record, "kind", str)),
            centre=records.number(record, "centre"),
            scale=records.number(record, "scale"),
            range=(low, high),
            levels=_two(records.texts(record, "levels")),
        )
        _require_sound_covariate(covariate)
        return covariate


@dataclass(frozen=True, eq=False)
class Population:
    """The subjects an atlas was made from, one row a visit.

    Attributes:
        covariates: the columns of ``values``.
        subjects: subject identifier of each row.
        visits: visit identifier of each row; (subject, visit) is unique.
        values: real units, float64 ``[n, len(covariates)]``.
        held_out: bool ``[n]``, true for the rows kept for evaluation; whole subjects only.
    """

    covariates: tuple[Covariate, ...]
    subjects: tuple[str, ...]
    visits: tuple[str, ...]
    values: NDArray[np.float64]
    held_out: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.subjects)

    @property
    def names(self) -> tuple[str, ...]:
        """The covariates' names, in column order."""
        return tuple(covariate.name for covariate in self.covariates)

    @property
    def centre(self) -> dict[str, float]:
        """Real values at which every ``c_i`` is 0."""
        return {covariate.name: covariate.centre for covariate in self.covariates}

    @property
    def tells_what_is_usual(self) -> bool:
        """Whether there are people enough, whom the networks were fitted to, to compare others with."""
        return int((~self.held_out).sum()) >= LEAST_PEOPLE

    def observed(self, name: str) -> NDArray[np.float64]:
        """Training values of one covariate in real units, ``[n_train]``."""
        return self.values[~self.held_out, self.names.index(name)]

    def row(self, index: int) -> dict[str, float]:
        """Real covariate values of one visit by name."""
        return dict(zip(self.names, map(float, self.values[index]), strict=True))

    def normalised(self) -> NDArray[np.float64]:
        """Centred covariates of all rows, ``[n, N]``."""
        columns = [c.normalise(self.values[:, i]) for i, c in enumerate(self.covariates)]
        return np.stack(columns, axis=1) if columns else np.zeros((len(self), 0))

    def keeping(self, names: Collection[str]) -> Population:
        """The same shapes with some of their covariates."""
        columns = [column for column, name in enumerate(self.names) if name in names]
        covariates = tuple(self.covariates[column] for column in columns)
        return replace(self, covariates=covariates, values=self.values[:, columns])

    def contains(self, values: Values) -> bool:
        """Whether every real value is in the observed range of its covariate, whoever is like that."""
        return all(c.contains(values.get(c.name, c.centre)) for c in self.covariates)

    def has_data_at(self, values: Values) -> bool:
        """Whether people like ``values`` are among those behind the atlas: :meth:`remoteness` is at most 1.

        Args:
            values: real values by name; a missing covariate is at its mean.
        """
        here = [values.get(c.name, c.centre) for c in self.covariates]
        return bool(self.remoteness(np.array([here]))[0] <= 1)

    def remoteness(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far combinations of covariates are from the people behind the atlas; the data end at 1.

        That is the distance to the :data:`NEIGHBOURS`-th nearest training row, over the continuous
        covariates in units of their spread, divided by the same distance of the rows among themselves that
        a share of :data:`EDGE_OF_DATA` of them keeps to.

        Args:
            places: real values, ``[m, N]``.

        Returns:
            ``[m]``; 0 everywhere where there are no continuous covariates, or too few rows to tell.
        """
        if not self._tells_data:
            return np.zeros(len(places))
        rows, usual = self._neighbourhood
        measured = zip(self._measured, places[:, self._measured].T, strict=True)
        here = np.stack([self.covariates[i].normalise(column) for i, column in measured], axis=1)
        return _loneliness(rows, here, NEIGHBOURS) / usual

    def stretches_with_data(self, name: str, values: Values) -> tuple[tuple[float, float], ...]:
        """Where along one covariate :meth:`has_data_at` holds, the others staying as they are.

        The NEIGHBOURS-th nearest row is near enough exactly where so many rows are, and each row is so along
        one interval about it: ``|t - t_j| <= sqrt(usual^2 - r_j^2)``, r_j being its distance in the others.

        Args:
            name: of the covariate that moves.
            values: real values by name; a missing covariate is at its mean.

        Returns:
            Low and high ends in real units, inside the observed range, in order.
        """
        covariate = self.covariates[self.names.index(name)]
        if covariate.kind == "binary" or not self._tells_data:
            return (covariate.range,) if self.has_data_at(values) else ()
        rows, usual = self._neighbourhood
        moving = [self.names[i] for i in self._measured].index(name)
        measured = [self.covariates[i] for i in self._measured]
        here = np.array([float(c.normalise(values.get(c.name, c.centre))) for c in measured])
        across = np.delete(np.square(rows - here), moving, axis=1).sum(axis=1)
        near = across <= usual**2
        reach = np.sqrt(usual**2 - across[near])
        ends = _covered(rows[near, moving] - reach, rows[near, moving] + reach, NEIGHBOURS)
        low, high = covariate.range
        real = covariate.restore(ends)
        return tuple((max(a, low), min(b, high)) for a, b in real.tolist() if b > low and a < high)

    @cached_property
    def _measured(self) -> list[int]:
        """Columns of the continuous covariates."""
        return [i for i, covariate in enumerate(self.covariates) if covariate.kind == "continuous"]

    @cached_property
    def _tells_data(self) -> bool:
        """Whether there is enough to tell where data are."""
        return bool(self._measured) and int(np.sum(~self.held_out)) > NEIGHBOURS

    @cached_property
    def _neighbourhood(self) -> tuple[NDArray[np.float64], float]:
        """The training rows, and how far their neighbours are at the edge of the data."""
        rows = self.normalised()[~self.held_out][:, self._measured]
        # One more: every row is its own nearest. By hand, because SciPy would delay the first picture.
        distances = _loneliness(rows, rows, NEIGHBOURS + 1)
        return rows, max(float(np.quantile(distances, EDGE_OF_DATA)), LEAST_SPREAD)

    def to_json(self) -> dict[str, Any]:
        """A plain dictionary that :meth:`from_json` reads back."""
        return {
            "covariates": [covariate.to_json() for covariate in self.covariates],
            "subjects": list(self.subjects),
            "visits": list(self.visits),
            "values": self.values.tolist(),
            "held_out": self.held_out.tolist(),
        }

    @classmethod
    def from_json(cls, record: dict[str, Any]) -> Population:
        """The inverse of :meth:`to_json`.

        Raises:
            ValueError: for what that never gives.
        """
        covariates = tuple(map(Covariate.from_json, records.rows(record, "covariates")))
        subjects = records.texts(record, "subjects")
        population = cls(
            covariates=covariates,
            subjects=subjects,
            visits=records.texts(record, "visits"),
            values=records.numbers(record, "values", len(subjects), len(covariates)),
            held_out=records.flags(record, "held_out"),
        )
        _require_sound_population(population)
        return population


def _require_sound_covariate(covariate: Covariate) -> None:
    """Refuse a covariate that no table can have given.

    Raises:
        ValueError: with what is wrong.
    """
    name, (low, high) = covariate.name, covariate.range
    wrong = {
        "a covariate has no name": not name.strip(),
        f"covariate '{name}' is of the unknown kind '{covariate.kind}'": covariate.kind not in KINDS,
        f"covariate '{name}' has the scale {covariate.scale:g}": not covariate.scale > 0,
        f"covariate '{name}' ranges from {low:g} to {high:g}": not low < high,
        f"covariate '{name}' has its centre at {covariate.centre:g}": not low <= covariate.centre <= high,
        f"covariate '{name}' has twice the level '{covariate.levels[0]}'": len(set(covariate.levels)) < 2,
        f"covariate '{name}' spans too many scales": not (high - low) / max(covariate.scale, 1e-99) < SCALES,
    }
    if reasons := [reason for reason, is_so in wrong.items() if is_so]:
        raise ValueError(reasons[0])
    if covariate.kind == "binary" and (covariate.centre, covariate.scale, low, high) != (0, 1, -1, 1):
        raise ValueError(f"covariate '{name}' has two levels that are not -1 and 1")


def _require_sound_population(population: Population) -> None:
    """Refuse people that no table can have given.

    Raises:
        ValueError: with what is wrong.
    """
    visits = list(zip(population.subjects, population.visits, strict=False))
    lengths = {len(population.subjects), len(population.visits), len(population.held_out)}
    if len(lengths) > 1:
        raise ValueError("the columns of the population differ in length")
    if len(set(population.names)) < len(population.names):
        raise ValueError("two covariates have the same name")
    if len(set(visits)) < len(visits):
        subject, visit = next(one for one in visits if visits.count(one) > 1)
        raise ValueError(f"subject '{subject}', visit '{visit}' is there twice")
    if population.held_out.all():
        raise ValueError("no shape is left to train on")
    seen = {subject for subject, held in zip(population.subjects, population.held_out, strict=True) if held}
    if shared := sorted(seen.intersection(np.array(population.subjects)[~population.held_out].tolist())):
        raise ValueError(f"subject '{shared[0]}' is trained on and held out")
    for column, covariate in enumerate(population.covariates):
        if covariate.kind == "binary" and not np.isin(population.values[:, column], (-1.0, 1.0)).all():
            raise ValueError(f"covariate '{covariate.name}' has values beside its two levels")


def _two(levels: tuple[str, ...]) -> tuple[str, str]:
    if len(levels) != 2:
        raise ValueError(f"a covariate has {len(levels)} levels instead of two")
    return levels[0], levels[1]


def interval_in_words(
    covariate: Covariate, low: float, high: float, told: Callable[[Covariate, float], str] = Covariate.format
) -> str:
    """``18.2 to 24.9 kg``; of a binary covariate the levels that are possible: ``F or M``.

    Args:
        covariate: whose values these are.
        low: its low end, real units.
        high: its high end.
        told: one value with its unit in words.
    """
    start, end = told(covariate, low), told(covariate, high)
    if start == end:
        return end
    if covariate.kind == "binary":
        return f"{start} or {end}"
    return f"{start.removesuffix(covariate.unit).rstrip()} to {end}"


def _in_between(levels: tuple[str, str], value: float) -> str:
    share = round(100 * abs(value))
    if not share:
        return f"halfway between {levels[0]} and {levels[1]}"
    return f"between {levels[0]} and {levels[1]}, {share} % towards {levels[int(value > 0)]}"


def require_known(names: Iterable[str], covariates: Iterable[Covariate]) -> None:
    """Make sure that ``names`` are those of covariates of an atlas.

    Raises:
        InputError: for another name.
    """
    known = [covariate.name for covariate in covariates]
    if unknown := [name for name in names if name not in known]:
        there = f"this atlas has {', '.join(known)}" if known else "its shapes depend on no covariates"
        raise InputError(f"unknown covariate '{unknown[0]}'; {there}")


def read_values(option: str, texts: Iterable[str], covariates: Iterable[Covariate]) -> dict[str, float]:
    """What was set as ``age=120`` or ``age=120,sex=M``, in real units.

    Names with commas or equals signs of their own are found among those of the covariates.

    Args:
        option: the settings stand behind it, as ``--set``.
        texts: of one or more settings each.
        covariates: of the atlas.

    Raises:
        InputError: for what is no setting, an unknown name, a name that is given twice or a value that its
            covariate cannot take.
    """
    known = {covariate.name: covariate for covariate in covariates}
    values: dict[str, float] = {}
    for setting in (setting for text in texts for setting in _settings(option, text, known)):
        own = (name for name in known if setting.startswith(f"{name}="))
        name = max(own, key=len, default=setting.partition("=")[0].rstrip())
        if name in values:
            raise InputError(f"'{name}' is given twice after {option}; give it once")
        if known and name not in known:
            raise InputError(
                f"unknown covariate '{name}' after {option}; write NAME=VALUE with one of {', '.join(known)}"
            )
        require_known([name], known.values())
        values[name] = known[name].parse(setting[setting.index("=", len(name)) + 1 :])
    return values


def _settings(option: str, text: str, known: Collection[str]) -> list[str]:
    """The parts between commas; those within a known name do not count."""
    settings: list[str] = []
    begun = ""
    for part in filter(str.strip, text.split(",")):
        whole = f"{begun},{part}".lstrip() if begun else part.lstrip()
        if "=" not in part:
            begun = whole
        elif begun and not any(whole.startswith(f"{name}=") for name in known):
            break
        else:
            begun = ""
            settings.append(whole)
    if begun or not settings:
        there = f"one of {', '.join(known)}" if known else "a covariate of an atlas that has some"
        raise InputError(f"'{begun or text}' after {option} is not understood; write NAME=VALUE with {there}")
    return settings


def complete(
    covariates: tuple[Covariate, ...], values: Values, *, extrapolate: bool = False
) -> dict[str, float]:
    """Fill in missing covariates with the population centre and check the others.

    Raises:
        InputError: for an unknown name, a value that is not finite, or (unless ``extrapolate``)
            one outside the observed range.
    """
    require_known(values, covariates)
    for covariate in covariates:
        value = values.get(covariate.name, covariate.centre)
        if not abs(value) <= records.LARGEST:
            raise InputError(f"covariate '{covariate.name}' is {value}; give a finite number")
        if not extrapolate and not covariate.contains(value):
            raise InputError(
                f"covariate '{covariate.name}' is {f'{value:g} {covariate.unit}'.rstrip()}; the atlas was "
                f"trained on {covariate.extent}; give a value within that"
            )
    return {c.name: float(values.get(c.name, c.centre)) for c in covariates}


def normalised_vector(covariates: tuple[Covariate, ...], values: Values) -> NDArray[np.float64]:
    """Complete real ``values`` as the vector ``c``, ``[N]``."""
    return np.array([float(c.normalise(values[c.name])) for c in covariates])


def growth_path(population: Population, name: str, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean of every covariate given one of them, from the training rows by local linear regression.

    Age and weight go together: a child of one year with the mean weight of the cohort does not exist.

    Args:
        population: its training rows are used.
        name: the covariate that moves.
        values: its real values, ``[n]``.

    Returns:
        Real values of all covariates in order, ``[n, N]``, inside the observed ranges.
    """
    column = population.names.index(name)
    rows = population.normalised()[~population.held_out]
    places = population.covariates[column].normalise(values)
    path = np.stack([_local_mean(rows[:, column], rows, float(place)) for place in places])
    path[:, column] = places
    real = [c.restore(path[:, i]).clip(*c.range) for i, c in enumerate(population.covariates)]
    return np.stack(real, axis=1)


def _local_mean(given: NDArray[np.float64], rows: NDArray[np.float64], place: float) -> NDArray[np.float64]:
    """Value at ``place`` of the straight lines fitted to ``rows [n, N]`` near it."""
    offset = given - place
    weights = np.exp(-0.5 * (offset / BANDWIDTH) ** 2) + 1e-9  # never all 0, far from the data either
    design = np.stack([np.ones_like(offset), offset], axis=1)
    ridge = np.diag([0.0, 1e-6 * weights.sum()])
    solution = np.linalg.solve((design.T * weights) @ design + ridge, (design.T * weights) @ rows)
    return np.asarray(solution[0])


def _loneliness(
    rows: NDArray[np.float64], places: NDArray[np.float64], neighbours: int
) -> NDArray[np.float64]:
    """Distance of each of ``places [m, N]`` to its so manieth nearest of ``rows [n, N]``, ``[m]``."""
    result = np.empty(len(places))
    for start in range(0, len(places), AT_ONCE):
        part = slice(start, start + AT_ONCE)
        squared = sum(
            np.square(here[:, None] - row) for here, row in zip(places[part].T, rows.T, strict=True)
        )
        result[part] = np.sqrt(np.partition(squared, neighbours - 1, axis=1)[:, neighbours - 1])
    return result


def _covered(starts: NDArray[np.float64], ends: NDArray[np.float64], times: int) -> NDArray[np.float64]:
    """Where so many of some intervals overlap, as low and high ends in order, ``[k, 2]``."""
    places = np.concatenate([starts, ends])
    steps = np.repeat([1, -1], len(starts))
    order = np.lexsort((-steps, places))  # what begins where another ends overlaps it
    count = np.cumsum(steps[order])
    is_start = (steps[order] == 1) & (count == times)
    is_end = (steps[order] == -1) & (count == times - 1)
    return np.stack([places[order][is_start], places[order][is_end]], axis=1)
