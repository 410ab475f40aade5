"""A shape; at rest with how sure its surface is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from naisr_model.progress import Progress
from naisr_viewer.engine.answers.base import Answer, Source
from naisr_viewer.engine.people import FittedPerson
from naisr_viewer.engine.surfaces import limit_mm
from naisr_viewer.state.layouts import FULL_SHAPE
from naisr_viewer.state.patients import Named
from naisr_viewer.state.requests import Colouring, SurfaceRequest, SurfaceResult

SHARE = 0.015
"""End of the colour scale, see :func:`~naisr_viewer.engine.surfaces.limit_mm`."""

PROBED, BLENDED = 1500, 4
"""Vertices at which the surface's uncertainty is computed, and how many of them are blended for each of the
others, by their inverse distances: it is smooth where the fit is good, within a tenth of its value."""


def _give(source: Source, request: SurfaceRequest, progress: Progress) -> SurfaceResult:
    fitted = source.who(request.atlas, request.person).fitted
    assert fitted is not None
    shape = source.surface(replace(request, panel=FULL_SHAPE), progress)
    if not shape.is_exact or not len(shape.faces):
        return replace(shape, request=request)
    return replace(shape, request=request, colouring=_margin(fitted, request.values, shape.points_mm))


def _margin(fitted: FittedPerson, values: Named, points_mm: NDArray[np.float32]) -> Colouring:
    """Half of the 95 % interval of a surface's place along its normal, at its vertices."""
    from scipy.spatial import cKDTree

    from naisr_model.learning.fitting.posterior import TWO_SIDED_95

    probed = points_mm[:: max(1, len(points_mm) // PROBED)]
    deviations_mm = fitted.at(values).surface_sd_mm(probed)
    away_mm, nearest = cKDTree(probed).query(points_mm, k=min(BLENDED, len(probed)))
    weights = 1 / (away_mm.reshape(len(points_mm), -1) + 1e-6)
    blended_mm = np.average(deviations_mm[nearest.reshape(weights.shape)], axis=1, weights=weights)
    half = (TWO_SIDED_95 * blended_mm).astype(np.float32)
    return Colouring(half, limit_mm(fitted.atlas_model, SHARE), "unsigned")


ANSWER = Answer(_give)
