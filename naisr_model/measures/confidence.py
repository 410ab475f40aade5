"""How sure the population's shapes are: how else they might be, had other people come.

What people differ from the population's shape by, at their own covariates, is regressed on the covariates:
additively, as the effects of the model add up, by a restricted cubic spline of each continuous covariate and
a step of each binary one. How far the answer moves when each subject in turn is left out, with all of their
visits, says how far it would move with other subjects. This is the jackknife: of G subjects its variance at a
place c is ``(G - 1) / G sum_k (b(c) . d_k)^2``, with the row ``b(c)`` of the design there and the change
``d_k`` of the coefficients without subject k (Bell and McCaffrey, 2002, call it CR3).

The networks follow the people they are trained on as such a regression does, though not exactly; how often
the truth lies within these bands is measured, see ``naisr evaluate confidence``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as students_t

from naisr_model.covariates import Population, Values, normalised_vector
from naisr_model.errors import InputError

KNOTS: Mapping[int, tuple[float, ...]] = {
    100: (0.025, 0.1833, 0.3417, 0.5, 0.6583, 0.8167, 0.975),
    50: (0.05, 0.275, 0.5, 0.725, 0.95),
    0: (0.1, 0.5, 0.9),
}
"""By the least number of subjects, the quantiles of a covariate at which its spline has knots: as Harrell
has them (Regression Modeling Strategies, 2015, section 2.4). With five of them for 210 subjects it went
unseen that the shipped airways are 6.5 % too small at 24 months."""

TWO_SIDED = 0.975
"""Quantile of Student's t at which a 95 % interval ends."""


@dataclass(frozen=True, eq=False)
class Design:
    """The additive regression of the training people on their covariates, K columns.

    Attributes:
        population: whose they are, with covariates.
        knots: of each covariate, centred values; None of one that is taken for straight.
    """

    population: Population
    knots: tuple[NDArray[np.float64] | None, ...]

    def rows(self, centred: NDArray[np.float64]) -> NDArray[np.float64]:
        """Of centred covariates ``[m, N]``, ``[m, K]``; the first column is 1."""
        splines = [
            column[:, None] if knots is None else restricted_spline(column, knots)
            for column, knots in zip(centred.T, self.knots, strict=True)
        ]
        return np.concatenate([np.ones((len(centred), 1)), *splines], axis=1)

    def row(self, values: Values) -> NDArray[np.float64]:
        """Of real values by name, those left out at the centre, ``[K]``."""
        there = self.population.centre | dict(values)
        return self.rows(normalised_vector(self.population.covariates, there)[None])[0]


@dataclass(frozen=True, eq=False)
class Confidence:
    """How sure something is that is told of the population at any covariates, or n such things.

    Attributes:
        design: of the regression.
        missed: coefficients of what the people differ by in the mean, ``[n, K]``.
        covariance: of the coefficients, ``[n, K, K]``.
        freedom: degrees of freedom, subjects less columns.
    """

    design: Design
    missed: NDArray[np.float64]
    covariance: NDArray[np.float64]
    freedom: int

    def margin(self, row: NDArray[np.float64]) -> NDArray[np.float64]:
        """Half of the 95 % interval, ``[n]``, in the unit of what was regressed.

        What the population's shape misses of the mean of its people counts as well as what other people
        might have changed: ``t sqrt(b V b + (b . m)^2)``.

        Args:
            row: b, of the design at some covariates, or the difference of two, ``[K]``.
        """
        variance = np.einsum("i,nij,j->n", row, self.covariance, row) + (self.missed @ row) ** 2
        return np.asarray(students_t.ppf(TWO_SIDED, self.freedom) * np.sqrt(variance))


def design_of(population: Population) -> Design:
    """For the training people of a population.

    Raises:
        InputError: when they are too few for their covariates, or all of one kind.
    """
    rows, subjects = _training(population)
    continuous = [covariate.kind == "continuous" for covariate in population.covariates]
    quantiles = next(KNOTS[least] for least in KNOTS if len(set(subjects)) >= least)
    knots = tuple(
        _knots(column, quantiles) if is_continuous else None
        for column, is_continuous in zip(rows.T, continuous, strict=True)
    )
    design = Design(population, knots)
    columns = design.rows(rows)
    if len(set(subjects)) <= columns.shape[1] or _rests_on_one(columns, subjects):
        raise InputError(
            f"{len(set(subjects))} subjects are too few to say how sure the effects of "
            f"{len(population.covariates)} covariates are; train on more"
        )
    return design


def confidence_of(design: Design, differences: NDArray[np.float64]) -> Confidence:
    """How sure the population's shapes are, by what its people differ from them.

    Args:
        design: for the training people, S visits.
        differences: of each visit from the population at the same covariates, ``[S, n]``.
    """
    rows, subjects = _training(design.population)
    columns = design.rows(rows)
    inverse = np.linalg.inv(columns.T @ columns)
    missed = inverse @ columns.T @ differences
    residuals = differences - columns @ missed
    visits = _visits(subjects)
    changes = np.stack([_change(columns[own], inverse, residuals[own]) for own in visits])
    covariance = (len(changes) - 1) / len(changes) * np.einsum("gin,gjn->nij", changes, changes)
    return Confidence(design, missed.T, covariance, len(changes) - columns.shape[1])


def restricted_spline(values: NDArray[np.float64], knots: NDArray[np.float64]) -> NDArray[np.float64]:
    """Columns ``[m, k - 1]`` of a cubic spline with k knots, straight beyond the outer ones.

    The truncated powers of Harrell (2015, section 2.4.4), divided by the squared range of the knots.
    """
    last, before = knots[-1], knots[-2]

    def cubed(knot: float) -> NDArray[np.float64]:
        return np.maximum(values - knot, 0.0) ** 3

    bent = [
        cubed(knot)
        - cubed(before) * (last - knot) / (last - before)
        + cubed(last) * (before - knot) / (last - before)
        for knot in knots[:-2]
    ]
    return np.stack([values, *(column / (last - knots[0]) ** 2 for column in bent)], axis=1)


def _training(population: Population) -> tuple[NDArray[np.float64], list[str]]:
    """Centred covariates of the training visits and their subjects."""
    own = ~population.held_out
    return population.normalised()[own], [population.subjects[i] for i in np.flatnonzero(own)]


def _rests_on_one(columns: NDArray[np.float64], subjects: Sequence[str]) -> bool:
    """Whether a coefficient cannot be told without one of the subjects, or not at all."""
    whole = np.linalg.matrix_rank(columns)
    others = (np.delete(columns, own, axis=0) for own in _visits(subjects))
    return bool(whole < columns.shape[1] or any(np.linalg.matrix_rank(rest) < whole for rest in others))


def _knots(column: NDArray[np.float64], quantiles: Sequence[float]) -> NDArray[np.float64] | None:
    """Where a covariate's spline bends; None where its values are too few to tell."""
    knots = np.unique(np.quantile(column, quantiles))
    return knots if len(knots) > 2 and len(np.unique(column)) > len(knots) else None


def _visits(subjects: Sequence[str]) -> list[NDArray[np.intp]]:
    """Of each subject."""
    named = np.array(subjects)
    return [np.flatnonzero(named == subject) for subject in dict.fromkeys(subjects)]


def _change(
    columns: NDArray[np.float64], inverse: NDArray[np.floating], residuals: NDArray[np.floating]
) -> NDArray[np.float64]:
    """How the coefficients change without the visits of one subject, ``[K, n]``, but for the sign."""
    leverage = columns @ inverse @ columns.T
    return np.asarray(inverse @ columns.T @ np.linalg.solve(np.eye(len(columns)) - leverage, residuals))
