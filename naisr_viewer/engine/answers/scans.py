"""A patient's scan with its distance to another scan, as both lie for their fits."""

from __future__ import annotations

import time

import numpy as np

from naisr_model.progress import Progress
from naisr_viewer.engine.answers.base import Answer, Source
from naisr_viewer.engine.answers.scan import SHARE
from naisr_viewer.engine.surfaces import limit_mm
from naisr_viewer.state.patients import Scan
from naisr_viewer.state.requests import EXACT_RESOLUTION, Colouring, Origin, SurfaceRequest, SurfaceResult


def _give(source: Source, request: SurfaceRequest, _progress: Progress) -> SurfaceResult:
    assert request.before is not None
    start, fitted = time.perf_counter(), source.who(request.atlas, request.person).fitted
    earlier = source.who(request.atlas, request.before[0]).fitted
    assert fitted is not None
    assert earlier is not None
    scan, limit = fitted.scan, limit_mm(fitted.atlas_model, SHARE)
    is_exact = request.resolution >= EXACT_RESOLUTION
    return SurfaceResult(
        request=request,
        points_mm=scan.points_mm,
        normals=scan.normals,
        faces=scan.faces,
        volume_cm3=scan.volume_cm3 or 0.0,
        seconds=time.perf_counter() - start,
        origin=Origin.MEASURED,
        volume_before_cm3=earlier.scan.volume_cm3,
        colouring=Colouring(_outside_mm(scan, earlier.scan), limit, "signed") if is_exact else None,
    )


def _outside_mm(scan: Scan, earlier: Scan) -> np.ndarray[tuple[int], np.dtype[np.float32]]:
    """Distance of the vertices of one scan to the surface of another, positive outside it, ``[n]``."""
    import trimesh

    from naisr_model.data.samples import signed_distance

    mesh_mm = trimesh.Trimesh(earlier.points_mm, earlier.faces, process=False)
    return signed_distance(mesh_mm, scan.points_mm.astype(np.float64)).astype(np.float32)


ANSWER = Answer(_give)
