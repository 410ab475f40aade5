"""What the networks, the tables and the scans give, as the results that the window draws. Knows no Qt."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from naisr_viewer.engine import members
from naisr_viewer.engine.members import Member
from naisr_viewer.state.requests import (
    EXACT_RESOLUTION,
    Origin,
    Progress,
    ShouldStop,
    SurfaceRequest,
    SurfaceResult,
)

if TYPE_CHECKING:
    import trimesh

    from naisr_model.atlas import Atlas
    from naisr_model.surface.tracking import Tracked, Tracker


def mesh(
    atlas: Atlas,
    request: SurfaceRequest,
    latent: NDArray[np.float64] | None,
    tracker: Tracker | None,
    progress: Progress | None,
    should_stop: ShouldStop | None,
) -> trimesh.Trimesh:
    """What the networks have at the values of ``request``; a tracker tells them where to look first."""
    panel, size = request.panel, request.resolution
    if panel.kind == "template":
        return atlas.template(size, progress=progress, should_stop=should_stop)
    if panel.kind == "effect":
        ((name, value),) = request.values
        return atlas.effect(
            name, value, latent, size, tracker=tracker, progress=progress, should_stop=should_stop
        )
    return atlas.shape(
        dict(request.values), latent, size, tracker=tracker, progress=progress, should_stop=should_stop
    )


def from_mesh(request: SurfaceRequest, mesh_mm: trimesh.Trimesh, start: float) -> SurfaceResult:
    """The answer to ``request`` that the networks gave, begun at ``start`` on the performance counter."""
    empty = len(mesh_mm.faces) == 0
    points_mm = np.zeros((0, 3)) if empty else np.asarray(mesh_mm.vertices)
    normals = np.zeros((0, 3)) if empty else np.asarray(mesh_mm.vertex_normals)
    faces = np.asarray(mesh_mm.faces, dtype=np.int64).reshape(-1, 3)
    return SurfaceResult(
        request=request,
        points_mm=points_mm.astype(np.float32),
        normals=normals.astype(np.float32),
        faces=faces,
        volume_cm3=volume_cm3(points_mm, normals, faces),
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
        volume_cm3=volume_cm3(tracked.points_mm, tracked.normals, tracker.faces),
        seconds=time.perf_counter() - start,
        origin=Origin.TABLES,
        doubtful=not tracked.is_trustworthy,
    )


def from_scan(request: SurfaceRequest, member: Member) -> SurfaceResult:
    """The scan, at rest with its distance to the shape."""
    start, is_exact = time.perf_counter(), request.resolution >= EXACT_RESOLUTION
    colouring = members.distances(member, request.values) if is_exact else None
    scan = member.scan
    return SurfaceResult(
        request=request,
        points_mm=scan.points_mm,
        normals=scan.normals,
        faces=scan.faces,
        volume_cm3=scan.volume_cm3 or 0.0,
        seconds=time.perf_counter() - start,
        origin=Origin.NETWORK,
        colouring=colouring,
    )


def with_certainty(shape: SurfaceResult, member: Member) -> SurfaceResult:
    """A shape, at rest with how sure its surface is."""
    if not shape.is_exact or not len(shape.faces):
        return shape
    return replace(shape, colouring=members.certainty(member, shape.request.values, shape.points_mm))


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


def at_nearest(
    places: NDArray[np.float32], values: NDArray[np.float32], points: NDArray[np.float32]
) -> NDArray[np.float32]:
    """The value at the nearest of ``places [n, 3]`` for each of ``points [m, 3]``."""
    from scipy.spatial import cKDTree

    result: NDArray[np.float32] = values[cKDTree(places).query(points)[1]]
    return result
