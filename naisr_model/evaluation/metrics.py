"""How far apart two closed surfaces are, in the definitions of the NAISR paper's tables.

Shapes are compared after both are divided by one scale, the target's largest distance from its
centre ("unit sphere"), so that large and small shapes count alike; values whose name ends in
``_x100`` are in hundredths of that scale. Surfaces stand for themselves by uniform random samples,
so two samplings of one and the same surface are not at distance 0: with n samples on area A, the
mean squared distance to the nearest is about A / (pi n).
"""

from __future__ import annotations

from dataclasses import dataclass

import igl
import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from naisr_model.errors import InputError

SAMPLES = 30_000
"""Surface samples of each shape for the nearest-neighbour distances."""

EMD_SAMPLES = 2048
"""Surface samples of each shape for the earth mover's distance, whose cost grows with their cube."""

Points = NDArray[np.float64]


@dataclass(frozen=True)
class Distances:
    """What separates a shape from its target.

    Attributes:
        cd_x100: Chamfer distance, :func:`chamfer` of the scaled shapes, times 100.
        hd_x100: Hausdorff distance, :func:`hausdorff` of the scaled shapes, times 100.
        hd95_x100: the same with 95th percentiles instead of maxima.
        emd_x100: earth mover's distance, :func:`earth_movers` of the scaled shapes, times 100.
        mean_mm: symmetric mean surface distance, :func:`mean_distance`, in millimetres, not scaled.
        vd_cm3: absolute difference of the enclosed volumes in cubic centimetres.
        samples: surface samples of each shape behind all but the EMD and the volume.
        emd_samples: surface samples of each shape behind the EMD.
    """

    cd_x100: float
    hd_x100: float
    hd95_x100: float
    emd_x100: float
    mean_mm: float
    vd_cm3: float
    samples: int
    emd_samples: int


@dataclass(frozen=True)
class Nearest:
    """Nearest-neighbour distances between two point sets, both ways.

    Attributes:
        forth: from each point of the first set to the second, ``[n]``.
        back: from each point of the second set to the first, ``[m]``.
    """

    forth: Points
    back: Points


def compare(
    target: trimesh.Trimesh,
    shape: trimesh.Trimesh,
    *,
    samples: int = SAMPLES,
    emd_samples: int = EMD_SAMPLES,
    seed: int = 0,
) -> Distances:
    """All distances of ``shape`` from ``target``, both in millimetres.

    Args:
        target: the true shape; it sets the scale.
        shape: the shape that is judged.
        samples: surface samples of each for the nearest-neighbour distances.
        emd_samples: surface samples of each for the EMD.
        seed: of the samples.

    Raises:
        InputError: when either has no faces.
    """
    scale_mm = unit_scale(target)
    here, there = _sample_pair(target, shape, max(samples, emd_samples), seed)
    nearest = nearest_distances(here[:samples], there[:samples])
    return Distances(
        cd_x100=100 * chamfer(nearest) / scale_mm**2,
        hd_x100=100 * hausdorff(nearest) / scale_mm,
        hd95_x100=100 * hausdorff(nearest, percentile=95) / scale_mm,
        emd_x100=100 * earth_movers(here[:emd_samples], there[:emd_samples]) / scale_mm,
        mean_mm=mean_distance(nearest),
        vd_cm3=volume_difference_cm3(target, shape),
        samples=samples,
        emd_samples=emd_samples,
    )


def unit_scale(target: trimesh.Trimesh) -> float:
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


def volume_difference_cm3(target: trimesh.Trimesh, shape: trimesh.Trimesh) -> float:
    """Absolute difference in cubic centimetres of the volumes that two surfaces in millimetres enclose."""
    return abs(float(shape.volume) - float(target.volume)) / 1000


def hausdorff_x100(
    target: trimesh.Trimesh, shape: trimesh.Trimesh, *, samples: int = SAMPLES, seed: int = 0
) -> float:
    """The Hausdorff distance of :func:`compare` alone."""
    nearest = nearest_distances(*_sample_pair(target, shape, samples, seed))
    return 100 * hausdorff(nearest) / unit_scale(target)


def component_count(mesh: trimesh.Trimesh) -> int:
    """Pieces of the surface that share no edge: 1 for a sound shape, 0 where there is no surface."""
    return int(igl.facet_components(np.asarray(mesh.faces))[0]) if len(mesh.faces) else 0


def _sample_pair(
    first: trimesh.Trimesh, second: trimesh.Trimesh, count: int, seed: int
) -> tuple[Points, Points]:
    """Independent samples of two surfaces, ``[count, 3]`` each."""
    one, other = np.random.SeedSequence(seed).spawn(2)
    return _sample(first, count, one), _sample(second, count, other)


def _sample(mesh: trimesh.Trimesh, count: int, seed: np.random.SeedSequence) -> Points:
    _require_surface(mesh)
    return np.asarray(trimesh.sample.sample_surface(mesh, count, seed=seed)[0])


def _require_surface(mesh: trimesh.Trimesh) -> None:
    if not len(mesh.faces):
        raise InputError("one of the shapes to compare has no surface; check it before asking for a distance")
