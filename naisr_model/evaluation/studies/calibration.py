"""Do the 95 % intervals of a fit hold the truth as often as they say? Asked of patients made for it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Any

import numpy as np
import trimesh

from naisr_model.atlas import Atlas, Fit
from naisr_model.data.populations import PopulationModule
from naisr_model.errors import Cancelled, InputError
from naisr_model.evaluation.studies.reconstruction import aligned, synthetic

Progress = Callable[[float], None]
StopCheck = Callable[[], bool]

OTHER_SEED = 1000
"""Added to the seed of the atlas's population, so that nobody in it is met again."""

AGREED = (0.90, 0.99)
"""Shares of intervals holding the truth that count as calibrated; of the two levels of a binary covariate
an interval can only hold one or both, so there the upper end does not count."""


def calibration(
    atlas: Atlas,
    patients: int,
    known: Collection[str] = (),
    *,
    progress: Progress | None = None,
    should_stop: StopCheck | None = None,
) -> dict[str, Any]:
    """Fit new synthetic patients and count how often their truth is inside the intervals.

    Args:
        atlas: of a synthetic population, which is asked for patients of another seed.
        patients: how many; each is seen once, inside the observed ranges.
        known: covariates that the fits are told; the others are inferred.
        progress: told the finished share.
        should_stop: polled between patients and steps.

    Returns:
        ``n``, ``known``, and in ``rows`` for each inferred covariate and the volume the ``coverage``,
        the median ``width`` of the interval, the root mean square ``error`` and the ``unit``; of a
        binary covariate the share of ``undecided`` and of ``wrong`` levels instead of the latter.

    Raises:
        InputError: when the atlas is not of a synthetic population or ``known`` has an unknown name.
        Cancelled: when ``should_stop()`` turned true.
    """
    module, names = synthetic(atlas), atlas.population.names
    if module is None:
        raise InputError("only atlases of synthetic populations can be calibrated; real truth is not known")
    if unknown := [name for name in known if name not in names]:
        raise InputError(f"unknown covariate '{unknown[0]}'; this atlas has {', '.join(names)}")
    rows: list[dict[str, tuple[float, float, float, float]]] = []
    for values, mesh_mm in _people(atlas, module, patients):
        if should_stop is not None and should_stop():
            raise Cancelled
        fit = atlas.fit(mesh_mm, {name: values[name] for name in known}, should_stop=should_stop)
        rows.append(_compared(fit, values, mesh_mm))
        if progress is not None:
            progress(len(rows) / patients)
    kinds = {covariate.name: (covariate.unit, covariate.kind) for covariate in atlas.covariates}
    kinds["volume"] = ("cm³", "continuous")
    summaries = {name: _summary([row[name] for row in rows], *kinds[name]) for name in rows[0]}
    return {"n": len(rows), "known": list(known), "rows": summaries}


def _people(
    atlas: Atlas, module: PopulationModule, patients: int
) -> Iterator[tuple[Mapping[str, float], trimesh.Trimesh]]:
    """The first visits of new patients whose covariates are inside the observed ranges."""
    seen: set[str] = set()
    seed = int(atlas.checkpoint.source["seed"]) + OTHER_SEED
    for visit in module.visits(seed, 2 * patients):
        inside = all(c.range[0] <= visit.values[c.name] <= c.range[1] for c in atlas.covariates)
        if inside and visit.subject not in seen and len(seen) < patients:
            seen.add(visit.subject)
            yield visit.values, aligned(atlas, *module.visit_shape(visit))


def _compared(
    fit: Fit, values: Mapping[str, float], mesh_mm: trimesh.Trimesh
) -> dict[str, tuple[float, float, float, float]]:
    """Truth, estimate and both ends of the interval of each inferred covariate and of the volume."""
    found = {name: (values[name], fit.covariates[name], *ends) for name, ends in fit.intervals.items()}
    return found | {"volume": (mesh_mm.volume / 1000, fit.volume_cm3, *fit.volume_interval_cm3)}


def _summary(rows: list[tuple[float, float, float, float]], unit: str, kind: str) -> dict[str, Any]:
    truth, estimate, low, high = np.array(rows).T
    rounding = 1e-9 * (1 + np.abs(truth))
    coverage = float(((low - rounding <= truth) & (truth <= high + rounding)).mean())
    if kind == "binary":
        wrong = float((np.sign(estimate) != np.sign(truth)).mean())
        return {"coverage": coverage, "undecided": float((high > low).mean()), "wrong": wrong}
    return {
        "coverage": coverage,
        "width": float(np.median(high - low)),
        "error": float(np.sqrt(np.mean((estimate - truth) ** 2))),
        "unit": unit,
    }


def calibration_markdown(report: Mapping[str, Any]) -> str:
    """The report of :func:`calibration` as a table."""
    given = f"{', '.join(report['known'])} known" if report["known"] else "nothing known"
    lines = [
        f"**{report['n']} new patients, {given}**",
        "",
        "|  | truth inside the 95 % interval | median width | root mean square error | calibrated |",
        "| --- | ---: | ---: | ---: | --- |",
    ]
    lines += [_markdown_row(name, row) for name, row in report["rows"].items()]
    return "\n".join(lines)


def _markdown_row(name: str, row: Mapping[str, Any]) -> str:
    low, high = AGREED
    if "wrong" in row:
        cells = [f"{row['undecided']:.0%} undecided", f"{row['wrong']:.0%} wrong"]
        agreed = low <= row["coverage"]
    else:
        cells = [f"{row['width']:.3g} {row['unit']}", f"{row['error']:.3g} {row['unit']}"]
        agreed = low <= row["coverage"] <= high
    return f"| {name} | {row['coverage']:.1%} | {' | '.join(cells)} | {'yes' if agreed else 'no'} |"
