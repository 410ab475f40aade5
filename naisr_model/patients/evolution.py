"""A fitted patient at other covariates: single steps and paths through time."""

from __future__ import annotations

import csv
import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from naisr_model.atlas import Atlas, Fit, Individual
from naisr_model.covariates import complete, growth_path, require_known
from naisr_model.errors import InputError


def fit_record(fit: Fit) -> dict[str, Any]:
    """What is told of a fit, for JSON: real units, mm and cm³.

    ``lasting`` is None where the model shows nobody on another day.
    """
    can = fit.individual.atlas.capabilities
    return {
        "covariates": fit.covariates,
        "inferred": list(fit.inferred),
        "intervals": {name: list(ends) for name, ends in fit.intervals.items()},
        "alternatives": [dataclasses.asdict(one) for one in fit.alternatives],
        "is_valid": fit.is_valid,
        "remarks": list(fit.remarks),
        "residual_mm": fit.residual_mm,
        "lasting": fit.lasting if can.transferable else None,
        "volume_cm3": fit.volume_cm3,
        "volume_interval_cm3": list(fit.volume_interval_cm3),
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
    if path not in ("population", "only"):
        return along_table(fit, Path(path))
    known = {covariate.name: covariate for covariate in fit.individual.atlas.covariates}
    require_known([along], known.values())
    if steps < 1:
        raise InputError(f"--steps is {steps}; give at least 1")
    first = fit.covariates[along] if start is None else start
    last = known[along].range[1] if stop is None else stop
    values = np.linspace(first, last, steps)
    return along_population(fit, along, values) if path == "population" else along_only(fit, along, values)


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
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"the path {path} cannot be read ({error}); correct it") from error
    if not rows:
        raise InputError(f"the path {path} has no rows; give a header of covariates and a row for each step")
    return [fit.at(parsed(fit.individual.atlas, row)) for row in rows]


def parsed(atlas: Atlas, texts: dict[str, str]) -> dict[str, float]:
    """Covariate values from texts by name.

    Raises:
        InputError: for an unknown covariate or a text that is no value of it.
    """
    known = {covariate.name: covariate for covariate in atlas.covariates}
    require_known(texts, known.values())
    return {name: known[name].parse(text or "") for name, text in texts.items()}
