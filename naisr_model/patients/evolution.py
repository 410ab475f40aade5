"""A fitted patient at other covariates: single steps and paths through time."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from naisr_model.atlas import Atlas, Fit, Individual
from naisr_model.covariates import complete, growth_path, require_known
from naisr_model.data.sheets import read_sheet, split_title
from naisr_model.errors import InputError

WAYS = ("population", "only")
"""From where to where somebody is followed without a table."""

MOST_STEPS = 1000
"""Shapes of one series; each takes a second or two."""


def fit_record(fit: Fit) -> dict[str, Any]:
    """What is told of a fit, for JSON: real units, mm and cm³; of curves their unit of length.

    ``lasting`` is None where the model shows nobody on another day.
    """
    atlas = fit.individual.atlas
    can, extent = atlas.capabilities, atlas.extent
    return {
        "covariates": fit.covariates,
        "inferred": list(fit.inferred),
        "intervals": {name: list(ends) for name, ends in fit.intervals.items()},
        "alternatives": [dataclasses.asdict(one) for one in fit.alternatives],
        "is_valid": fit.is_valid,
        "remarks": list(fit.remarks),
        f"residual_{atlas.frame.unit}": fit.residual_mm,
        "lasting": fit.lasting if can.transferable else None,
        extent.key(): fit.extent,
        extent.key("interval"): list(fit.extent_interval),
        "seconds": fit.seconds,
        "latent": fit.latent.tolist(),
    }


def evolution(
    fit: Fit, along: str, start: float | None, stop: float | None, steps: int, path: str
) -> list[Individual]:
    """The patient from ``start`` to ``stop`` of the covariate ``along``.

    Args:
        fit: of the patient.
        along: the covariate that moves.
        start: its first real value; None for the patient's.
        stop: its last one; None for the largest observed.
        steps: shapes, both ends included.
        path: ``population``, ``only``, or the name of a CSV of covariates, which alone counts then.

    Raises:
        InputError: for an unknown covariate, a value out of range, too few steps or an unreadable CSV.
    """
    atlas = fit.individual.atlas
    require_way(atlas, along, start, stop, steps, path)
    if path not in WAYS:
        return along_table(fit, Path(path))
    first = fit.covariates[along] if start is None else start
    last = atlas.covariates[atlas.population.names.index(along)].range[1] if stop is None else stop
    values = np.linspace(first, last, steps)
    return along_population(fit, along, values) if path == "population" else along_only(fit, along, values)


def require_way(
    atlas: Atlas, along: str, start: float | None, stop: float | None, steps: int, path: str
) -> None:
    """Make sure that :func:`evolution` can go where it is asked to, whoever the patient is.

    Raises:
        InputError: for an unknown covariate, a value out of range, too few or too many steps, or an
            unreadable CSV.
    """
    if path not in WAYS:
        for row in _rows(atlas, Path(path)):
            atlas.complete(row)
        return
    require_known([along], atlas.covariates)
    if not 1 <= steps <= MOST_STEPS:
        raise InputError(f"--steps is {steps}; give 1 to {MOST_STEPS}")
    for end in (start, stop):
        if end is not None:
            atlas.complete({along: end})


def along_population(fit: Fit, name: str, values: NDArray[np.float64]) -> list[Individual]:
    """The patient along the growth path.

    The patient's own difference from the path, at the patient's value of the covariate that moves, is
    kept, and binary covariates stay as they are.
    """
    population, own = fit.individual.atlas.population, fit.covariates
    path = growth_path(population, name, np.append(values, own[name]))
    result = []
    for place, value in zip(path, values, strict=False):
        step = {name: float(value)}
        for i, covariate in enumerate(population.covariates):
            if covariate.kind == "continuous" and covariate.name != name:
                kept = own[covariate.name] + place[i] - path[-1, i]
                step[covariate.name] = float(np.clip(kept, *covariate.range))
        result.append(fit.at(step))
    return result


def along_only(fit: Fit, name: str, values: NDArray[np.float64]) -> list[Individual]:
    """Phi_i of the patient: one covariate moves, the others are at the population centre."""
    atlas = fit.individual.atlas
    column = atlas.population.names.index(name)
    result = []
    for value in values:
        complete(atlas.covariates, {name: float(value)})
        vector = np.zeros(len(atlas.covariates))
        vector[column] = float(atlas.covariates[column].normalise(value))
        result.append(fit.individual.elsewhere(vector))
    return result


def along_table(fit: Fit, path: Path) -> list[Individual]:
    """The patient at each row of a CSV whose header names covariates; those left out stay as fitted.

    Raises:
        InputError: when the file cannot be read, has no row, or holds what is no covariate value.
    """
    return [fit.at(row) for row in _rows(fit.individual.atlas, path)]


def _rows(atlas: Atlas, path: Path) -> list[dict[str, float]]:
    """Covariate values of each row of a CSV."""
    try:
        sheet = read_sheet(path).records()
    except InputError as error:
        raise InputError(f"the path {path} cannot be read: {error}") from error
    if not sheet:
        raise InputError(f"the path {path} has no rows; give a header of covariates and a row for each step")
    if len(sheet) > MOST_STEPS:
        raise InputError(f"the path {path} has {len(sheet)} rows; give 1 to {MOST_STEPS}")
    names = [split_title(title)[0] for title in sheet[0]]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise InputError(f"the path {path} has the column '{twice[0]}' twice; leave one of them out")
    return [parsed(atlas, dict(zip(names, record.values(), strict=True))) for record in sheet]


def parsed(atlas: Atlas, texts: dict[str, str]) -> dict[str, float]:
    """Covariate values from texts by name.

    Raises:
        InputError: for an unknown covariate or a text that is no value of it.
    """
    known = {covariate.name: covariate for covariate in atlas.covariates}
    require_known(texts, known.values())
    return {name: known[name].parse(text) for name, text in texts.items()}
