"""A patient's scan; at rest with its distance to the person's shape."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from naisr_model.progress import Progress
from naisr_viewer.engine.answers.base import Answer, Source
from naisr_viewer.engine.people import FittedPerson
from naisr_viewer.engine.surfaces import from_scan, limit_mm
from naisr_viewer.state.patients import Named
from naisr_viewer.state.requests import EXACT_RESOLUTION, Colouring, SurfaceRequest, SurfaceResult

SHARE = 0.02
"""End of the colour scale, see :func:`~naisr_viewer.engine.surfaces.limit_mm`."""


def _give(source: Source, request: SurfaceRequest, _progress: Progress) -> SurfaceResult:
    start, fitted = time.perf_counter(), source.who(request.atlas, request.person).fitted
    assert fitted is not None
    found = from_scan(request, fitted.scan, start)
    if request.resolution < EXACT_RESOLUTION:
        return found
    distances = _distances(fitted, request.values)
    return replace(found, colouring=distances, unexpressed=_unexpressed(fitted, request.values))


def _distances(fitted: FittedPerson, values: Named) -> Colouring:
    """How far the scan is from the person's shape at ``values``, at its vertices; positive outside."""
    atlas, latent = fitted.atlas_model, fitted.at(values).latent
    found = atlas.sdf(fitted.scan.points_mm, dict(values), latent)
    return Colouring(found.astype(np.float32), limit_mm(atlas, SHARE), "signed")


def _unexpressed(fitted: FittedPerson, values: Named) -> float | None:
    """Share of the scan that the atlas cannot express; only of the fit itself, not of another day."""
    if values != tuple(fitted.fit.covariates.items()) or not len(fitted.scan.points_mm):
        return None
    return float(fitted.fit.individual.unexpressed(fitted.scan.points_mm).mean())


ANSWER = Answer(_give)
