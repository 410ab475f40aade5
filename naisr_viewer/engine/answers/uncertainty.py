"""A shape; at rest with how sure its surface is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from naisr_model.progress import Progress
from naisr_viewer.engine.answers.base import Answer, Source
from naisr_viewer.engine.surfaces import limit_mm
from naisr_viewer.state.layouts import FULL_SHAPE
from naisr_viewer.state.requests import Colouring, SurfaceRequest, SurfaceResult

SHARE = 0.015
"""End of the colour scale, see :func:`~naisr_viewer.engine.surfaces.limit_mm`."""


def _give(source: Source, request: SurfaceRequest, progress: Progress) -> SurfaceResult:
    fitted = source.who(request.atlas, request.person).fitted
    assert fitted is not None
    shape = replace(source.surface(replace(request, panel=FULL_SHAPE), progress), request=request)
    if not shape.is_exact or not len(shape.faces):
        return shape
    margin_mm = fitted.at(request.values).surface_margin_mm(shape.points_mm).astype(np.float32)
    return replace(shape, colouring=Colouring(margin_mm, limit_mm(fitted.atlas_model, SHARE), "unsigned"))


ANSWER = Answer(_give)
