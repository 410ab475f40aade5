"""The vocabulary of a population: what was measured of each shape, in real units.

A model never sees months or kilograms: :meth:`Covariate.normalise` maps a real value to the
centred number ``c_i`` of the paper, where 0 is the population centre.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from naisr_model.errors import InputError

Kind = Literal["continuous", "binary"]
Values = Mapping[str, float]
"""Covariate values in real units by name; for a binary covariate -1 ... +1."""

BANDWIDTH = 0.3
"""Of the kernel that makes the growth path, in standard deviations of the covariate that moves."""

RANGE_SLACK = 1e-9
"""Real units that a value may be out of range: to model units and back costs the last digits."""

EDGE_OF_DATA = 0.98
"""A combination lonelier than this share of the population is where there are no data."""

NEIGHBOURS = 3
"""How many shapes must be near a combination for it to be among the data."""

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

    def contains(self, value: float) -> bool:
        """Whether a real value is in the observed range."""
        low, high = self.range
        return low - RANGE_SLACK <= value <= high + RANGE_SLACK

    def parse(self, text: str) -> float:
        """Read ``text`` as a real value: a number, or the name of a level.

        Raises:
            InputError: when ``text`` is neither.
        """
        text = text.strip()
        if self.kind == "binary" and text in self.levels:
            return (-1.0, 1.0)[self.levels.index(text)]
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            expected = " or ".join(self.levels) if self.kind == "binary" else f"a number in {self.unit}"
            raise InputError(f"covariate '{self.name}' is '{text}'; expected {expected}")
        return value

    def format(self, value: float) -> str:
        """The value as people write it, with its unit: ``120 months``, ``M``, ``halfway between F and M``."""
        if self.kind == "binary":
            if abs(value) == 1:
                return self.levels[int(value > 0)]
            return _in_between(self.levels, value)
        return f"{value:.4g} {self.unit}".rstrip()

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
        """The inverse of :meth:`to_json`."""
        low, high = record["range"]
        minus, plus = record["levels"]
        return cls(
            name=str(record["name"]),
            unit=str(record["unit"]),
            kind=record["kind"],
            centre=float(record["centre"]),
            scale=float(record["scale"]),
            range=(float(low), float(high)),
            levels=(str(minus), str(plus)),
        )


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
        """Whether people like ``values`` are among those behind the atlas.

        Compares the distance to the :data:`NEIGHBOURS`-th nearest training row, over the continuous
        covariates in units of their spread, with the same distance of the rows among themselves.

        Args:
            values: real values by name; a missing covariate is at its mean.
        """
        measured = [covariate for covariate in self.covariates if covariate.kind == "continuous"]
        if not measured or np.count_nonzero(~self.held_out) <= NEIGHBOURS:
            return True
        rows, usual = self._neighbourhood
        here = np.array([float(c.normalise(values.get(c.name, c.centre))) for c in measured])
        return _loneliness(rows, here, NEIGHBOURS) <= usual

    @cached_property
    def _neighbourhood(self) -> tuple[NDArray[np.float64], float]:
        """The training rows, and how far their neighbours are at the edge of the data."""
        columns = [i for i, covariate in enumerate(self.covariates) if covariate.kind == "continuous"]
        rows = self.normalised()[~self.held_out][:, columns]
        # One more: every row is its own nearest. By hand, because SciPy would delay the first picture.
        distances = [_loneliness(rows, row, NEIGHBOURS + 1) for row in rows]
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
        """The inverse of :meth:`to_json`."""
        covariates = tuple(Covariate.from_json(item) for item in record["covariates"])
        values = np.asarray(record["values"], dtype=np.float64)
        return cls(
            covariates=covariates,
            subjects=tuple(map(str, record["subjects"])),
            visits=tuple(map(str, record["visits"])),
            values=values.reshape(len(record["subjects"]), len(covariates)),
            held_out=np.asarray(record["held_out"], dtype=bool),
        )


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
        low, high = covariate.range
        if not math.isfinite(value):
            raise InputError(f"covariate '{covariate.name}' is {value}; give a finite number")
        if not extrapolate and not covariate.contains(value):
            raise InputError(
                f"covariate '{covariate.name}' is {value:g} {covariate.unit}; the atlas was trained on "
                f"{low:g} to {high:g}; give a value within that"
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


def _loneliness(rows: NDArray[np.float64], here: NDArray[np.float64], neighbours: int) -> float:
    """Distance of ``here [N]`` to its so manieth nearest of ``rows [n, N]``."""
    squared = np.square(rows - here).sum(axis=1)
    return float(np.sqrt(np.partition(squared, neighbours - 1)[neighbours - 1]))
