"""A patient's scan with its distance to another scan, as both lie for their fits."""

from __future__ import annotations

import time
from dataclasses import replace

from naisr_model.progress import Progress
from naisr_viewer.engine.answers.base import Answer, Source
from naisr_viewer.engine.answers.scan import SHARE
from naisr_viewer.engine.surfaces import from_scan, limit_mm, outside_mm
from naisr_viewer.state.requests import EXACT_RESOLUTION, Colouring, SurfaceRequest, SurfaceResult


def _give(source: Source, request: SurfaceRequest, _progress: Progress) -> SurfaceResult:
    assert request.before is not None
    start, fitted = time.perf_counter(), source.who(request.atlas, request.person).fitted
    earlier = source.who(request.atlas, request.before[0]).fitted
    assert fitted is not None
    assert earlier is not None
    colouring = None
    if request.resolution >= EXACT_RESOLUTION:
        limit = limit_mm(fitted.atlas_model, SHARE)
        colouring = Colouring(outside_mm(fitted.scan, earlier.scan), limit, "signed")
    found = from_scan(request, fitted.scan, start)
    return replace(found, extent_before=earlier.scan.extent, colouring=colouring)


ANSWER = Answer(_give)
