"""Dragging a slider: tables, the time that a position takes, and how far the preview is off."""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import numpy as np
import torch
from numpy.typing import NDArray

from naisr_model.benchmark.figures import Figure, Figures
from naisr_model.benchmark.subject import Scope, Subject, size
from naisr_model.benchmark.timing import timed
from naisr_model.surface.tracking import Tracker


def figures(scope: Scope) -> tuple[Figure, ...]:
    """What is measured, in the order of the table."""
    return (
        Figure(
            "drag_p95_ms",
            "ms",
            "95th percentile of the time in which the full shape and the dragged covariate's own are "
            "carried to the next position of a slider, each slider there and back over its range, on one "
            "thread, as in the window on two cores",
            at_most=33.0,
        ),
        Figure(
            "drag_mean_voxels",
            "voxels",
            "mean distance, to first order, of the preview's vertices from the exact surface, in voxels "
            "of 128³; full shapes and single effects at the covariates of people of the population",
            at_most=0.25,
        ),
        Figure(
            "drag_p99_voxels",
            "voxels",
            "99th percentile of the same distances",
            at_most=1.0,
        ),
        Figure(
            "drag_flagged_share",
            "",
            "share of those previews that the tracker itself calls untrustworthy",
        ),
        Figure(
            "table_build_s",
            "s",
            f"tabulating every displacement of one code, at {size(scope)}",
            at_most=4.0,
        ),
    )


def measure(subject: Subject) -> Figures:
    """Tables, the time a slider takes, and how far the preview is from the exact surface."""
    template = subject.atlas.template(subject.scope.resolutions[0])
    times = [
        timed(partial(subject.sized.tabulate, template, progress=subject.progress.quiet))
        for _ in range(subject.scope.repeats)
    ]
    tracker = subject.atlas.tracker(template, subject.atlas.tabulate(template))
    with _one_thread():
        waits = [
            seconds
            for covariate in subject.atlas.covariates
            for seconds in _waits(
                subject, tracker, covariate.name, np.linspace(*covariate.range, subject.scope.frames)
            )
        ]
    errors, flagged = _preview_errors(subject, tracker)
    return {
        "table_build_s": statistics.median(times),
        "drag_p95_ms": 1000 * float(np.percentile(waits, 95)),
        "drag_mean_voxels": float(errors.mean()),
        "drag_p99_voxels": float(np.percentile(errors, 99)),
        "drag_flagged_share": float(flagged),
    }


@contextmanager
def _one_thread() -> Iterator[None]:
    """Two threads wait for each other where another program has a core, five times as long at worst."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def _waits(subject: Subject, tracker: Tracker, name: str, values: NDArray[np.float64]) -> Iterator[float]:
    """Seconds of every frame while a slider moves there and back; the others stand where somebody is."""
    others = subject.atlas.population.row(subject.few[0])
    full, single = tracker.track(others | {name: values[0]}), tracker.track({name: values[0]})
    for value in np.concatenate([values[1:], values[-2::-1]]).tolist():
        subject.progress.check()
        start = time.perf_counter()
        full, single = tracker.track(others | {name: value}, full), tracker.track({name: value}, single)
        yield time.perf_counter() - start


def _preview_errors(subject: Subject, tracker: Tracker) -> tuple[NDArray[np.float64], float]:
    """Distances in voxels of 128^3 of all vertices, and the share of previews that are flagged."""
    voxel_mm = 2 * subject.atlas.frame.scale_mm / 128
    errors, trusted = [], []
    for row in subject.people:
        subject.progress.check()
        values = subject.atlas.population.row(int(row))
        for shown in (values, *({name: value} for name, value in values.items())):
            tracked = tracker.track(shown)
            errors.append(np.abs(subject.atlas.sdf(tracked.points_mm, shown)) / voxel_mm)
            trusted.append(tracked.is_trustworthy)
    return np.concatenate(errors), 1 - statistics.mean(trusted)
