"""What the networks and the tables give, as the results that the window draws."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from naisr_viewer.state.patients import Scan
from naisr_viewer.state.requests import Origin, SurfaceRequest, SurfaceResult

if TYPE_CHECKING:
    from naisr_model.atlas import Atlas
    from naisr_model.frames import Frame
    from naisr_model.shapes.kinds import Shape
    from naisr_model.surface.tracking import Tracked, Tracker


def from_shape(request: SurfaceRequest, shape_mm: Shape, frame: Frame, start: float) -> SurfaceResult:
    """The answer to ``request`` that the networks gave, begun at ``start`` on the performance counter."""
    from naisr_model.surface.volume import enclosed

    empty = len(shape_mm.faces) == 0
    nothing = np.zeros((0, frame.dim))
    points_mm = nothing if empty else np.asarray(shape_mm.vertices)
    normals = nothing if empty else np.asarray(shape_mm.vertex_normals)
    faces = np.asarray(shape_mm.faces, dtype=np.int64).reshape(-1, frame.dim)
    return SurfaceResult(
        request=request,
        points_mm=points_mm.astype(np.float32),
        normals=normals.astype(np.float32),
        faces=faces,
        extent=0.0 if empty else enclosed(shape_mm) / frame.extent.per_unit,
        seconds=time.perf_counter() - start,
        origin=Origin.NETWORK,
    )


def from_tracked(request: SurfaceRequest, tracker: Tracker, tracked: Tracked, start: float) -> SurfaceResult:
    """The preview for ``request`` that the tables gave, begun at ``start`` on the performance counter."""
    return SurfaceResult(
        request=request,
        points_mm=tracked.points_mm,
        normals=tracked.normals,
        faces=tracker.faces,
        extent=volume_cm3(tracked.points_mm, tracked.normals, tracker.faces),
        seconds=time.perf_counter() - start,
        origin=Origin.TABLES,
        doubtful=not tracked.is_trustworthy,
    )


def from_scan(request: SurfaceRequest, scan: Scan, start: float) -> SurfaceResult:
    """A scan as it was read, as the answer to ``request``, begun at ``start`` on the performance counter."""
    return SurfaceResult(
        request=request,
        points_mm=scan.points_mm,
        normals=scan.normals,
        faces=scan.faces,
        extent=scan.extent or 0.0,
        seconds=time.perf_counter() - start,
        origin=Origin.MEASURED,
    )


def volume_cm3(points_mm: NDArray, normals: NDArray, faces: NDArray[np.int64]) -> float:
    """What a surface encloses: vertices and unit normals there ``[n, 3]``, triangles ``[m, 3]``."""
    from naisr_model.surface.volume import enclosed_volume

    return enclosed_volume(points_mm, normals, faces) / 1000.0


def deviation_mm(points_mm: NDArray[np.float32], exact: SurfaceResult) -> float:
    """Distance to the exact surface that 99 % of the points keep, along the normal of the nearest vertex."""
    from scipy.spatial import cKDTree

    nearest = cKDTree(exact.points_mm).query(points_mm)[1]
    offsets = points_mm - exact.points_mm[nearest]
    return float(np.quantile(np.abs(np.sum(offsets * exact.normals[nearest], axis=1)), 0.99))


def outside_mm(one: SurfaceResult | Scan, other: SurfaceResult | Scan) -> NDArray[np.float32]:
    """Distance of the vertices of one shape to another shape, positive outside it, ``[n]``."""
    from naisr_model.shapes.kinds import KINDS

    kind = KINDS[other.points_mm.shape[1]]
    shape_mm = kind.made(other.points_mm.astype(np.float64), other.faces)
    return kind.distances(shape_mm, one.points_mm.astype(np.float64)).astype(np.float32)


def at_nearest(
    places: NDArray[np.float32], values: NDArray[np.float32], points: NDArray[np.float32]
) -> NDArray[np.float32]:
    """The value at the nearest of ``places [n, dim]`` for each of ``points [m, dim]``."""
    from scipy.spatial import cKDTree

    result: NDArray[np.float32] = values[cKDTree(places).query(points)[1]]
    return result


def limit_mm(atlas: Atlas, share: float) -> float:
    """The end of a colour scale: a share of the atlas's unit of length, rounded to 1, 2 or 5.

    The unit is about half of its largest shape. Ends never depend on a person, so people can be compared.
    """
    return rounded(share * atlas.frame.scale_mm)


def rounded(length: float) -> float:
    """The nearest of 1, 2, 5, 10, 20, 50 ... by ratio."""
    decade = 10.0 ** math.floor(math.log10(length))
    return min((step * decade for step in (1, 2, 5, 10)), key=lambda step: abs(math.log(step / length)))
