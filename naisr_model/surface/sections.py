"""Where a plane cuts a surface, and how large the cut is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, eq=False)
class PlaneSection:
    """A surface cut by a plane.

    Attributes:
        points_mm: where edges of triangles pass through the plane, ``[n, 3]``.
        lines: pairs of them, one a triangle that is cut, ``[k, 2]``; head to tail around the inside.
        area_mm2: of what the lines enclose, holes taken off; None where they do not close.
    """

    points_mm: NDArray[np.float64]
    lines: NDArray[np.int64]
    area_mm2: float | None


def section(points_mm: ArrayLike, faces: ArrayLike, normal: ArrayLike, offset_mm: float) -> PlaneSection:
    """The section of triangles with the plane ``normal . p = offset_mm``.

    A vertex in the plane counts as above it, so that lines close wherever the surface does. The area is exact
    for the polygons: half of the sum of ``normal . (a x b)`` over the lines from a to b.

    Args:
        points_mm: vertices, ``[v, 3]``.
        faces: vertex numbers of triangles with outward faces, ``[m, 3]``.
        normal: of the plane, of length 1.
        offset_mm: of the plane from the origin, along the normal.
    """
    points, upwards = np.asarray(points_mm, np.float64), np.asarray(normal, np.float64)
    heights = points @ upwards - offset_mm
    is_above = heights >= 0
    starts = np.asarray(faces, np.int64).reshape(-1, 3)
    starts = starts[is_above[starts].sum(axis=1) % 3 != 0]
    ends = np.roll(starts, -1, axis=1)
    edges = np.minimum(starts, ends) * len(points) + np.maximum(starts, ends)
    falling, rising = is_above[starts] & ~is_above[ends], ~is_above[starts] & is_above[ends]
    crossed, places = np.unique(np.concatenate([edges[falling], edges[rising]]), return_inverse=True)
    low, high = np.divmod(crossed, max(len(points), 1))
    share = heights[low] / (heights[low] - heights[high])
    found_mm = points[low] + share[:, None] * (points[high] - points[low])
    lines = places.reshape(2, -1).T
    is_closed = all(np.array_equal(np.sort(side), np.arange(len(crossed))) for side in lines.T)
    return PlaneSection(found_mm, lines, _area(found_mm, lines, upwards) if is_closed else None)


def _area(points_mm: NDArray[np.float64], lines: NDArray[np.int64], normal: NDArray[np.float64]) -> float:
    """Counted from a point nearby, which the sum does not depend on."""
    if len(lines) == 0:
        return 0.0
    near = points_mm - points_mm[0]
    return float(np.cross(near[lines[:, 0]], near[lines[:, 1]]).sum(axis=0) @ normal) / 2
