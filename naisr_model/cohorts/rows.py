"""One row of a cohort: its scan read, aligned, fitted and measured, in whatever process.

Every row is done on one thread: then a result is the same, to the last digit, for any number of processes.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from threadpoolctl import threadpool_limits

from naisr_model.atlas import Atlas, Fit
from naisr_model.cohorts.table import CohortRow
from naisr_model.errors import InputError
from naisr_model.evaluation.held_out import opened
from naisr_model.measures.curves import shapes_along
from naisr_model.measures.kept import load_norms
from naisr_model.measures.kinds import MEASURES, Surface, surface_of
from naisr_model.measures.norms import Norms
from naisr_model.patients.evolution import fit_record
from naisr_model.patients.fitting import fitted_in_place
from naisr_model.patients.intake import take_in
from naisr_model.progress import SILENT, Progress
from naisr_model.work.journal import Record, plain


@dataclass(frozen=True)
class CohortOptions:
    """How the scans of a cohort are read and what is measured of them.

    Attributes:
        align: none or icp; a row with landmarks is aligned by these.
        label: of label volumes, where the table gives none for a row.
        scale: millimetres per unit of the files; None to guess where the size is implausible.
        measures: names of :data:`~naisr_model.measures.kinds.MEASURES`; what shapes enclose is always told.
    """

    align: Literal["none", "icp"] = "none"
    label: str | None = None
    scale: float | None = None
    measures: tuple[str, ...] = ("area",)


@dataclass(frozen=True)
class Bench:
    """What every row of a cohort is fitted with; paths only, so that it is cheap to send.

    Attributes:
        atlas: the .safetensors file.
        norms: what is usual among its people, see :mod:`~naisr_model.measures.kept`; None where nothing is.
        options: how scans are read and measured.
    """

    atlas: Path
    norms: Path | None
    options: CohortOptions


def fit_row(bench: Bench, row: CohortRow, progress: Progress = SILENT) -> Record:
    """What is found out about one row, in plain JSON types.

    Returns:
        ``reason`` alone where it cannot be used. Else what ``naisr fit`` tells, ``patient`` as it was read,
        and in ``measures`` by name ``value``, ``unit`` and, where it is known what is usual,
        ``percentile`` and ``z`` among people of the same covariates.

    Raises:
        InputError: when the atlas cannot be read.
        Cancelled: when nobody waits any more.
    """
    if row.fault:
        return {"reason": row.fault}
    atlas, norms = opened(bench.atlas), _usual(bench)
    started = time.perf_counter()
    with threadpool_limits(1):
        try:
            found = _fitted(row, bench.options, atlas, norms, progress)
        except InputError as error:
            return {"reason": str(error)}
    return plain({**found, "seconds": time.perf_counter() - started})


def _usual(bench: Bench) -> Norms | None:
    return None if bench.norms is None else _loaded(bench.norms, bench.atlas)


@lru_cache(maxsize=1)
def _loaded(norms: Path, atlas: Path) -> Norms:
    return load_norms(norms, opened(atlas))


def _fitted(
    row: CohortRow, options: CohortOptions, atlas: Atlas, norms: Norms | None, progress: Progress
) -> Record:
    known = dict(row.known)
    intake = take_in(
        row.scan,
        atlas,
        known,
        label=row.label or options.label,
        scale=options.scale,
        align=options.align if row.landmarks is None else "landmarks",
        landmarks=row.landmarks,
        progress=progress.quiet,
    )
    fit, lies = fitted_in_place(intake, atlas, known, progress=progress)
    record: Record = {"patient": lies.to_json(), **fit_record(fit), "measures": {}}
    if fit.is_valid:
        record["measures"], trouble = _measures(fit, options.measures, norms)
        record["remarks"] += trouble
    return record


def _measures(fit: Fit, names: Sequence[str], norms: Norms | None) -> tuple[Record, list[str]]:
    """What the shape encloses, and the measures that are asked for; and why one of them is missing."""
    extent = fit.individual.atlas.extent
    told: Record = {extent.title: {"value": fit.extent, "unit": extent.unit}}
    try:
        shape = _surface(fit, norms) if set(names) - {extent.title} else None
        for name in names:
            if shape is not None and name != extent.title and MEASURES[name].is_possible(shape):
                told[name] = {"value": MEASURES[name].of(shape), "unit": MEASURES[name].unit}
        return _among_people(told, fit, norms), []
    except InputError as error:
        return told, [f"not measured: {error}"]


def _surface(fit: Fit, norms: Norms | None) -> Surface:
    """The fitted shape as the norms measure it; its own surface where there are none."""
    if norms is None:
        return surface_of(fit.individual.surface)
    atlas, person = fit.individual.atlas, fit.individual
    return shapes_along(atlas, norms.gauge.fine, [fit.covariates], person)[0]


def _among_people(told: Record, fit: Fit, norms: Norms | None) -> Record:
    if norms is None:
        return told
    values = {name: one["value"] for name, one in told.items()}
    found: dict[str, Any] = norms.norms(fit.covariates, values)
    return {name: {**one, **(asdict(found[name]) if name in found else {})} for name, one in told.items()}
