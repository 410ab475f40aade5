"""How far apart two closed surfaces, or curves, are, in the definitions of the NAISR paper's tables.

Shapes are compared after both are divided by one scale, the target's largest distance from its
centre ("unit sphere"), so that large and small shapes count alike; values whose name ends in
``_x100`` are in hundredths of that scale. Surfaces stand for themselves by uniform random samples,
so two samplings of one and the same surface are not at distance 0: with n samples on area A, the
mean squared distance to the nearest is about A / (pi n); on a curve of length L it is L^2 / (2 n^2).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from naisr_model.errors import InputError
from naisr_model.shapes.kinds import Shape, kind_of

SAMPLES = 30_000
"""Surface samples of each shape for the nearest-neighbour distances."""

EMD_SAMPLES = 2048
"""Surface samples of each shape for the earth mover's distance, whose cost grows with their cube."""

Points = NDArray[np.float64]


@dataclass(frozen=True)
class Nearest:
    """Nearest-neighbour distances between two point sets, both ways.

    Attributes:
        forth: from each point of the first set to the second, ``[n]``.
        back: from each point of the second set to the first, ``[m]``.
    """

    forth: Points
    back: Points


@dataclass(frozen=True, eq=False)
class Pair:
    """A shape and its target as the metrics see them; what several of them need is computed once.

    Attributes:
        target: the true shape, millimetres.
        shape: the shape that is judged, millimetres.
        samples: surface samples of each for the nearest-neighbour distances.
        emd_samples: surface samples of each for the EMD.
        seed: of the samples.
    """

    target: Shape
    shape: Shape
    samples: int = SAMPLES
    emd_samples: int = EMD_SAMPLES
    seed: int = 0

    @cached_property
    def scale_mm(self) -> float:
        """What both are divided by, :func:`unit_scale` of the target."""
        return unit_scale(self.target)

    @cached_property
    def points(self) -> tuple[Points, Points]:
        """Independent samples of the two surfaces, ``[n, dim]`` each, enough for every metric."""
        one, other = np.random.SeedSequence(self.seed).spawn(2)
        count = max(self.samples, self.emd_samples)
        return _sample(self.target, count, one), _sample(self.shape, count, other)

    @cached_property
    def nearest(self) -> Nearest:
        """Nearest-neighbour distances in millimetres of the first ``samples`` points, both ways."""
        here, there = self.points
        return nearest_distances(here[: self.samples], there[: self.samples])

    @property
    def few_points(self) -> tuple[Points, Points]:
        """The first ``emd_samples`` points of each."""
        here, there = self.points
        return here[: self.emd_samples], there[: self.emd_samples]


HUNDREDTHS = "x10²"
"""Unit of what is scaled: hundredths of the target's largest distance from its centre."""


@dataclass(frozen=True)
class Metric:
    """One way to say how far a shape is from its target; everything that tells of it is made from this.

    Attributes:
        key: its name in records.
        title: its name in tables.
        unit: of its values.
        definition: in words, for whoever reads a report.
        measure: its value for a pair of shapes.
    """

    key: str
    title: str
    unit: str
    definition: str
    measure: Callable[[Pair], float]

    @property
    def column(self) -> str:
        """Title and unit, as a table's header has them."""
        return f"{self.title} {self.unit}" if self.unit == HUNDREDTHS else f"{self.title}, {self.unit}"


@dataclass(frozen=True)
class Distances:
    """What separates a shape from its target.

    Attributes:
        values: by the keys of :data:`METRICS` or :data:`PLANE_METRICS`, in their order.
        samples: surface samples of each shape behind all but the EMD and the volume.
        emd_samples: surface samples of each shape behind the EMD.
    """

    values: Mapping[str, float]
    samples: int
    emd_samples: int

    def __getitem__(self, key: str) -> float:
        return self.values[key]

    def to_json(self) -> dict[str, Any]:
        """One flat record."""
        return {**self.values, "samples": self.samples, "emd_samples": self.emd_samples}

    @classmethod
    def from_json(cls, record: Mapping[str, Any]) -> Distances:
        """Of what :meth:`to_json` gave."""
        values = {metric.key: record[metric.key] for metric in all_metrics() if metric.key in record}
        return cls(values, record["samples"], record["emd_samples"])


def compare(
    target: Shape,
    shape: Shape,
    *,
    samples: int = SAMPLES,
    emd_samples: int = EMD_SAMPLES,
    seed: int = 0,
) -> Distances:
    """All :data:`METRICS`, of curves :data:`PLANE_METRICS`, of a shape against its target, in millimetres.

    Args:
        target: the true shape; it sets the scale.
        shape: the shape that is judged.
        samples: surface samples of each for the nearest-neighbour distances.
        emd_samples: surface samples of each for the EMD.
        seed: of the samples.

    Raises:
        InputError: when either has no faces.
    """
    pair = Pair(target, shape, samples, emd_samples, seed)
    asked = metrics_in(kind_of(target).dim)
    return Distances({metric.key: metric.measure(pair) for metric in asked}, samples, emd_samples)


def unit_scale(target: Shape) -> float:
    """Largest distance in millimetres of the surface from the centre of its bounding box."""
    _require_surface(target)
    used = target.vertices[np.unique(target.faces)]
    centre = (used.min(axis=0) + used.max(axis=0)) / 2
    return float(np.linalg.norm(used - centre, axis=1).max())


def nearest_distances(here: Points, there: Points) -> Nearest:
    """Nearest-neighbour distances between ``here [n, dim]`` and ``there [m, dim]``, both ways."""
    return Nearest(cKDTree(there).query(here)[0], cKDTree(here).query(there)[0])


def chamfer(nearest: Nearest) -> float:
    """Sum of the two mean **squared** nearest-neighbour distances (the definition of DeepSDF)."""
    return float(np.mean(nearest.forth**2) + np.mean(nearest.back**2))


def mean_distance(nearest: Nearest) -> float:
    """Mean of the two one-sided mean nearest-neighbour distances, not squared."""
    return float(nearest.forth.mean() + nearest.back.mean()) / 2


def hausdorff(nearest: Nearest, percentile: float = 100.0) -> float:
    """The larger of the two one-sided maxima, or of other percentiles of the distances."""
    return float(max(np.percentile(nearest.forth, percentile), np.percentile(nearest.back, percentile)))


def earth_movers(here: Points, there: Points) -> float:
    """Mean distance of the cheapest one-to-one assignment of ``here [n, dim]`` to ``there [n, dim]``.

    This is exact balanced optimal transport between two equal-size samples; its time grows as n^3.
    """
    costs = cdist(here, there)
    return float(costs[linear_sum_assignment(costs)].mean())


def volume_difference_cm3(target: Shape, shape: Shape) -> float:
    """Absolute difference in cubic centimetres of the volumes that two surfaces in millimetres enclose."""
    return abs(float(shape.volume) - float(target.volume)) / 1000


def component_count(shape: Shape) -> int:
    """Pieces of the surface that share no edge: 1 for a sound shape, 0 where there is no surface."""
    return kind_of(shape).pieces(shape)


def _sample(shape: Shape, count: int, seed: np.random.SeedSequence) -> Points:
    _require_surface(shape)
    return np.asarray(shape.sample(count, seed=seed))


def _require_surface(mesh: Shape) -> None:
    if not len(mesh.faces):
        raise InputError("one of the shapes to compare has no surface; check it before asking for a distance")


CHAMFER = Metric(
    "cd_x100",
    "CD",
    HUNDREDTHS,
    "Chamfer distance: sum of the two mean squared nearest-neighbour distances, x 100",
    lambda pair: 100 * chamfer(pair.nearest) / pair.scale_mm**2,
)
HAUSDORFF = Metric(
    "hd_x100",
    "HD",
    HUNDREDTHS,
    "Hausdorff distance: the larger of the two one-sided maxima, x 100",
    lambda pair: 100 * hausdorff(pair.nearest) / pair.scale_mm,
)
HAUSDORFF_95 = Metric(
    "hd95_x100",
    "HD95",
    HUNDREDTHS,
    "as HD with the one-sided 95th percentiles, x 100",
    lambda pair: 100 * hausdorff(pair.nearest, percentile=95) / pair.scale_mm,
)
EARTH_MOVERS = Metric(
    "emd_x100",
    "EMD",
    HUNDREDTHS,
    "earth mover's distance: mean ground distance of the exact one-to-one assignment, x 100; "
    "random samples of one and the same surface are not at 0",
    lambda pair: 100 * earth_movers(*pair.few_points) / pair.scale_mm,
)
MEAN_DISTANCE = Metric(
    "mean_mm",
    "mean distance",
    "mm",
    "mean of the two one-sided mean nearest-neighbour distances, in mm, not scaled",
    lambda pair: mean_distance(pair.nearest),
)
VOLUME_DIFFERENCE = Metric(
    "vd_cm3",
    "VD",
    "cm³",
    "absolute volume difference in cm³",
    lambda pair: volume_difference_cm3(pair.target, pair.shape),
)

METRICS = (CHAMFER, HAUSDORFF, HAUSDORFF_95, EARTH_MOVERS, MEAN_DISTANCE, VOLUME_DIFFERENCE)
"""All that reports tell, in the order of their columns."""

PLANE_DISTANCE = Metric(
    "mean_distance",
    "mean distance",
    "units of length",
    "mean of the two one-sided mean nearest-neighbour distances, not scaled",
    MEAN_DISTANCE.measure,
)
AREA_DIFFERENCE = Metric(
    "ad",
    "AD",
    "units of length²",
    "absolute area difference, not scaled",
    lambda pair: abs(float(pair.shape.volume) - float(pair.target.volume)),
)

PLANE_METRICS = (CHAMFER, HAUSDORFF, HAUSDORFF_95, EARTH_MOVERS, PLANE_DISTANCE, AREA_DIFFERENCE)
"""The same of curves in the plane, whose unit of length is that of their atlas."""


def metrics_in(dim: int) -> tuple[Metric, ...]:
    """All that is told of shapes of so many dimensions."""
    return PLANE_METRICS if dim == 2 else METRICS


def all_metrics() -> tuple[Metric, ...]:
    """Those of surfaces, then those that curves alone have."""
    return tuple(dict.fromkeys((*METRICS, *PLANE_METRICS)))
