"""A shape; at rest with its distance to the population's average at the same covariates."""

from __future__ import annotations

from dataclasses import replace

from naisr_model.progress import Progress
from naisr_viewer.engine.answers.base import Answer, Source
from naisr_viewer.engine.surfaces import limit_mm, outside_mm
from naisr_viewer.state.layouts import FULL_SHAPE
from naisr_viewer.state.requests import Colouring, SurfaceRequest, SurfaceResult

SHARE = 0.08
"""End of the colour scale, see :func:`~naisr_viewer.engine.surfaces.limit_mm`."""


def _give(source: Source, request: SurfaceRequest, progress: Progress) -> SurfaceResult:
    full = replace(request, panel=FULL_SHAPE)
    shape = replace(source.surface(full, progress.part(0.0, 0.5)), request=request)
    if not shape.is_exact:
        return shape
    average = source.surface(replace(full, person=0), progress.part(0.5, 1.0))
    if not (len(shape.faces) and len(average.faces)):
        return shape
    limit = limit_mm(source.atlas(request.atlas), SHARE)
    return replace(shape, colouring=Colouring(outside_mm(shape, average), limit, "signed"))


ANSWER = Answer(_give)
