"""A shape; at rest with how far it lies beyond what 95 % of people of the same covariates have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from naisr_model.progress import Progress
from naisr_viewer.engine.answers.base import Answer, Source
from naisr_viewer.state.layouts import FULL_SHAPE
from naisr_viewer.state.requests import Colouring, SurfaceRequest, SurfaceResult

LIMIT = 2.0
"""End of the colour scale, standard deviations beyond the band."""


def _give(source: Source, request: SurfaceRequest, progress: Progress) -> SurfaceResult:
    from naisr_model.learning.fitting.posterior import TWO_SIDED_95

    plain = replace(request, panel=FULL_SHAPE, is_judged=False)
    shape = replace(source.surface(plain, progress), request=request)
    norms = source.known_norms(request.atlas) if request.is_judged else None
    if norms is None or not shape.is_exact or not len(shape.faces):
        return shape
    scores = norms.local.scores(norms.atlas, shape.points_mm, dict(request.values))
    beyond = np.sign(scores) * np.maximum(np.abs(scores) - TWO_SIDED_95, 0.0)
    return replace(shape, colouring=Colouring(beyond.astype(np.float32), LIMIT, "signed"))


ANSWER = Answer(_give)
