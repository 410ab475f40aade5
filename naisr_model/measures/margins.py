"""How sure the measures of a fitted person are.

To first order a measure changes with the surface's offset along its normal. The offsets are those of the
fit's posterior, see :mod:`naisr_model.learning.fitting.posterior`: each of its independent directions is
tried, and so is what the atlas cannot express, as an offset of each of many patches of the surface by itself.
The variances add up.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from naisr_model.atlas import Individual
from naisr_model.learning.fitting.posterior import INDEPENDENT_OFFSETS, TWO_SIDED_95
from naisr_model.measures.kinds import Measure, Surface


def margins(individual: Individual, shape: Surface, measures: Mapping[str, Measure]) -> dict[str, float]:
    """Half of the 95 % interval of some measures of a person's shape, in their units.

    Args:
        individual: whose shape it is.
        shape: the template carried to the person, n vertices.
        measures: by name; those that the shape has.
    """
    points = np.asarray(shape.points_mm, dtype=np.float64)
    patches = individual.noise_mm * _patches(points, round(INDEPENDENT_OFFSETS))
    offsets_mm = np.concatenate([individual.surface_offsets_mm(points), patches])
    normals = np.asarray(shape.mesh.vertex_normals)
    others = [shape.moved(points + offset[:, None] * normals) for offset in offsets_mm]
    return {name: TWO_SIDED_95 * _deviation(one, shape, others) for name, one in measures.items()}


def _deviation(measure: Measure, shape: Surface, others: list[Surface]) -> float:
    here = measure.of(shape)
    return float(np.linalg.norm([measure.of(other) - here for other in others]))


def _patches(points: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Which of the points belong to each of as many patches, 0 or 1, ``[count, n]``.

    Their middles are far from one another: each is the point that is farthest from those before.
    """
    away = np.linalg.norm(points - points.mean(axis=0), axis=1)
    nearest, distances = np.zeros(len(points), dtype=np.intp), np.full(len(points), np.inf)
    for number in range(count):
        middle = points[int((away if number == 0 else distances).argmax())]
        here = np.linalg.norm(points - middle, axis=1)
        nearest[here < distances] = number
        distances = np.minimum(distances, here)
    return (nearest == np.arange(count)[:, None]).astype(np.float64)
