"""Exact surfaces: sparse against dense evaluation, one mesh from end to end, and how the work grows."""

from __future__ import annotations

import math
import statistics
from functools import partial

import numpy as np
import torch
from numpy.typing import NDArray

from naisr_model.atlas import Atlas
from naisr_model.benchmark.figures import Figure, Figures
from naisr_model.benchmark.subject import Scope, Subject, latent, size
from naisr_model.benchmark.timing import timed
from naisr_model.surface.fields import shape_field
from naisr_model.surface.lattice import Lattice
from naisr_model.surface.sparse import Field, evaluate_band, evaluate_everywhere

SAMPLE_RESOLUTION = 40
"""Cells along a side of the lattice on which the speed of the dense evaluation is measured."""

SPEEDUPS = {128: 25.0, 256: 60.0}
"""Targets by resolution."""


def figures(scope: Scope) -> tuple[Figure, ...]:
    """What is measured, in the order of the table."""
    (low, high), first = scope.growth, scope.resolutions[0]
    dense = "its speed is measured on a small lattice over the same box and scaled by the number of nodes"
    return (
        *(
            Figure(
                f"exact_speedup_{n}",
                "",
                f"time of evaluating a shape at all {n}³ cells' nodes over that of evaluate_band, at "
                f"{size(scope)}, median over people; the dense one is not run in full: {dense}",
                at_least=SPEEDUPS.get(n),
            )
            for n in scope.resolutions
        ),
        Figure(
            f"exact_{first}_s",
            "s",
            f"from covariates and code to the mesh of a full shape at {first}³, at {size(scope)}",
        ),
        Figure(
            "evaluation_growth_exponent",
            "",
            f"log(evaluations at {high}³ / evaluations at {low}³) / log({high} / {low}) of evaluate_band",
            at_most=2.2,
        ),
    )


def measure(subject: Subject) -> Figures:
    """Times at the size that is measured; the growth is counted."""
    return _times(subject) | _growth(subject)


def _field(atlas: Atlas, row: int) -> Field:
    """The full shape of one person of the training population."""
    vector = torch.as_tensor(atlas.population.normalised()[row], dtype=torch.float32)
    network = atlas.checkpoint.model().to(atlas.device)
    return shape_field(network, vector, torch.as_tensor(latent(atlas, row)))


def _times(subject: Subject) -> Figures:
    """Sparse against dense, and one mesh from end to end."""
    fields = [_field(subject.sized, row) for row in subject.few]
    fields[0](np.zeros((SAMPLE_RESOLUTION, 3), np.float32))
    found = {
        f"exact_speedup_{n}": statistics.median(_speedup(field, n, subject) for field in fields)
        for n in subject.scope.resolutions
    }
    resolution = subject.scope.resolutions[0]
    people = [(subject.atlas.population.row(row), latent(subject.sized, row)) for row in subject.few]
    times = [timed(partial(subject.sized.shape, *person, resolution)) for person in people]
    return found | {f"exact_{resolution}_s": statistics.median(times)}


def _speedup(field: Field, resolution: int, subject: Subject) -> float:
    """Time of the dense evaluation, scaled up from a sample, over that of the sparse one."""
    sample, lattice = Lattice(SAMPLE_RESOLUTION), Lattice(resolution)
    share = math.prod(lattice.shape) / math.prod(sample.shape)
    dense = share * timed(partial(evaluate_everywhere, field, sample))
    return dense / timed(partial(evaluate_band, field, lattice, subject.progress.quiet))


def _growth(subject: Subject) -> Figures:
    """Counted on the atlas's own networks: the field and therefore the counts are the same."""
    field = _field(subject.atlas, subject.few[0])
    low, high = subject.scope.growth
    ratio = evaluations(field, high) / evaluations(field, low)
    return {"evaluation_growth_exponent": math.log(ratio) / math.log(high / low)}


def evaluations(field: Field, resolution: int) -> int:
    """How often ``evaluate_band`` asks for the field."""
    asked = 0

    def counting(points: NDArray[np.float32]) -> NDArray[np.float32]:
        nonlocal asked
        asked += len(points)
        return field(points)

    evaluate_band(counting, Lattice(resolution))
    return asked
