"""All measures of one shape beside what is usual, as commands tell them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from naisr_model.atlas import Individual
from naisr_model.covariates import Values
from naisr_model.errors import InputError
from naisr_model.learning.fitting.posterior import TWO_SIDED_95
from naisr_model.measures.curves import shapes_along
from naisr_model.measures.kinds import Surface, measured
from naisr_model.measures.norms import Norms


def measure_record(norms: Norms, covariates: Values, person: Individual | None = None) -> dict[str, Any]:
    """Every measure of a shape among people of the same covariates, for JSON: mm, cm² and cm³.

    Args:
        norms: of the atlas.
        covariates: of the people to compare with, real values by name.
        person: a fit at these covariates; the population average when left out.

    Returns:
        ``covariates``, and in ``measures`` by name ``value``, ``unit``, ``definition``, ``median``, ``low``,
        ``high``, ``percentile`` and ``z``; of the average also ``sure_low`` and ``sure_high``, between which
        it is with a probability of 95 %, where the people of the atlas are enough to say; of what is
        tube-like the ``sections``; of a person's closed surface the share ``outside`` the population's 95 %
        band.

    Raises:
        InputError: for an unknown covariate or one out of range.
    """
    atlas = norms.atlas
    (shape,) = shapes_along(atlas, norms.gauge.fine, [covariates], person)
    values = {name: value for name, value in measured(shape).items() if name in norms.spreads}
    found = norms.norms(covariates, values)
    sure = _sure(norms, covariates, values) if person is None else {}
    rows = {
        name: {"value": values[name], "unit": one.unit, "definition": one.definition}
        | asdict(found[name])
        | sure.get(name, {})
        for name, one in norms.gauge.measures.items()
        if name in found
    }
    record: dict[str, Any] = {"covariates": atlas.complete(covariates), "measures": rows}
    if shape.tube is not None:
        record["sections"] = _sections(shape)
    if person is not None and shape.is_closed:
        scores = norms.local.scores(atlas, shape.points_mm, covariates)
        record["outside"] = float(np.mean(np.abs(scores) > TWO_SIDED_95))
    return record


def _sure(norms: Norms, covariates: Values, values: Mapping[str, float]) -> dict[str, dict[str, float]]:
    """Where the average is with a probability of 95 %; nothing where people are too few to say."""
    try:
        ends = {name: norms.intervals(name, [covariates], value)[:, 0] for name, value in values.items()}
    except InputError:
        return {}
    return {name: {"sure_low": float(low), "sure_high": float(high)} for name, (low, high) in ends.items()}


def _sections(shape: Surface) -> dict[str, Any]:
    assert shape.tube is not None
    found = shape.tube.sections(shape.points_mm)
    return {
        "places_mm": found.places_mm.tolist(),
        "areas_mm2": found.areas_mm2.tolist(),
        "centres_mm": found.centres_mm.tolist(),
        "narrowest_at_mm": float(found.places_mm[found.narrowest]),
    }
