"""A shape with the way that its points have come since another; plain while previews are coarse."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from naisr_model.errors import InputError
from naisr_model.progress import Progress
from naisr_viewer.engine.answers.base import Answer, Source
from naisr_viewer.engine.people import FittedPerson
from naisr_viewer.engine.surfaces import at_nearest, limit_mm, volume_cm3
from naisr_viewer.state.layouts import FULL_SHAPE
from naisr_viewer.state.requests import EXACT_RESOLUTION, Colouring, Origin, SurfaceRequest, SurfaceResult

if TYPE_CHECKING:
    from naisr_model.surface.tracking import Tracked

SHARE = 0.08
"""End of the colour scale, see :func:`~naisr_viewer.engine.surfaces.limit_mm`."""


def _give(source: Source, request: SurfaceRequest, progress: Progress) -> SurfaceResult:
    assert request.before is not None
    path, (person, values) = request.atlas, request.before
    shape = replace(
        source.surface(replace(request, panel=FULL_SHAPE, before=None), progress), request=request
    )
    if not len(shape.faces):
        return shape
    if shape.dim == 2:
        return _of_curve(source, request, shape, progress)
    for each in {request.person, person} if shape.is_exact else ():
        source.prepare_previews(path, each, progress)
    _, fitted, tracker = source.who(path, request.person)
    earlier = source.who(path, person).tracker
    if fitted is None or tracker is None or earlier is None:
        return shape
    first = later = source.previews.track_before(path, person, values, earlier)
    before_mm = first.points_mm
    if shape.origin is Origin.NETWORK:
        later = tracker.track(dict(request.values))  # the same wherever the hand has been before
        moved_mm = first.points_mm - later.points_mm
        before_mm = shape.points_mm + at_nearest(later.points_mm, moved_mm, shape.points_mm)
    return replace(
        shape,
        colouring=_moved(fitted, before_mm, shape),
        extent_before=_volume_before_cm3(source, request, first, tracker.faces, progress.quiet),
        doubtful=shape.doubtful or not (first.is_trustworthy and later.is_trustworthy),
    )


def _of_curve(
    source: Source, request: SurfaceRequest, shape: SurfaceResult, progress: Progress
) -> SurfaceResult:
    """The same in the plane, where the networks find the points of the earlier curve in no time."""
    assert request.before is not None
    person, values = request.before
    fitted, earlier = (source.who(request.atlas, each).fitted for each in (request.person, person))
    if fitted is None:
        return shape
    atlas, here = source.atlas(request.atlas), fitted.at(request.values)
    before = np.zeros_like(here.latent) if earlier is None else earlier.at(values).latent
    origins_mm = atlas.origins_mm(shape.points_mm, dict(request.values), here.latent)
    try:
        before_mm = atlas.carried_mm(origins_mm, [dict(values)], [before])[0]
    except InputError:
        return replace(shape, doubtful=True)
    return replace(
        shape,
        colouring=_moved(fitted, before_mm.astype(np.float32), shape),
        extent_before=source.surface(_asked_before(request), progress.quiet).extent,
    )


def _moved(fitted: FittedPerson, before_mm: NDArray[np.float32], shape: SurfaceResult) -> Colouring:
    """How far corresponding points ``[n, dim]`` have moved along the normals of the later surface."""
    moved_mm = np.sum((shape.points_mm - before_mm) * shape.normals, axis=1)
    return Colouring(moved_mm.astype(np.float32), limit_mm(fitted.atlas_model, SHARE), "signed")


def _asked_before(request: SurfaceRequest) -> SurfaceRequest:
    """The shape that a change is counted from."""
    assert request.before is not None
    person, values = request.before
    return replace(request, panel=FULL_SHAPE, person=person, values=values, before=None)


def _volume_before_cm3(
    source: Source, request: SurfaceRequest, first: Tracked, faces: NDArray[np.int64], progress: Progress
) -> float:
    """Of the same kind as the later volume: both exact, or both of previews."""
    if request.resolution < EXACT_RESOLUTION:
        return volume_cm3(first.points_mm, first.normals, faces)
    return source.surface(_asked_before(request), progress).extent


ANSWER = Answer(_give)
