"""Surfaces with what covariates do to them, point by point: from the networks at rest, from tables before."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from naisr_model.covariates import Covariate
from naisr_viewer.engine.surfaces import limit_mm, rounded
from naisr_viewer.state.overlay import Map, Quantity
from naisr_viewer.state.patients import Named
from naisr_viewer.state.requests import Colouring, Origin, SurfaceRequest, SurfaceResult

if TYPE_CHECKING:
    from naisr_model.atlas import Atlas
    from naisr_model.surface.tracking import Tracker

SHARE = 0.08
"""End of the colour scale of displacements, see :func:`~naisr_viewer.engine.surfaces.limit_mm`."""

STEP = 0.01
"""Of a difference of previews, as a share of a covariate's observed range."""


def coloured(
    request: SurfaceRequest,
    shape: SurfaceResult,
    atlas: Atlas,
    latent: NDArray[np.float64] | None,
    tracker: Tracker | None,
) -> SurfaceResult:
    """``shape`` with the map that ``request`` asks for.

    Args:
        request: what is asked.
        shape: its surface.
        atlas: whose surface it is.
        latent: the person's code; None for the population average.
        tracker: what carried the surface, where it is a preview by tables.

    Raises:
        InputError: when points have no place at a level, because the deformation folds.
    """
    assert request.map is not None
    shape = replace(shape, request=request)
    if not len(shape.faces):
        return shape
    covariate = _covariate(atlas, request.map)
    if tracker is not None and shape.origin is Origin.TABLES:
        values = _by_tables(request.values, shape, tracker, covariate)
    else:
        values = _by_networks(request.values, shape, atlas, latent, covariate)
    return replace(shape, colouring=Colouring(values.astype(np.float32), _limit(atlas, covariate), "signed"))


def _covariate(atlas: Atlas, shown: Map) -> Covariate | None:
    """What a rate is of; None of a displacement."""
    if shown.quantity is Quantity.DISPLACEMENT:
        return None
    return next(each for each in atlas.covariates if each.name == shown.covariate)


def _by_networks(
    values: Named,
    shape: SurfaceResult,
    atlas: Atlas,
    latent: NDArray[np.float64] | None,
    covariate: Covariate | None,
) -> NDArray[np.float32]:
    if covariate is None:
        return atlas.moved_mm(shape.points_mm, dict(values), latent)
    ask = atlas.contrast_mm if covariate.kind == "binary" else atlas.rates_mm
    return ask(shape.points_mm, covariate.name, dict(values), latent)


def _by_tables(
    values: Named, shape: SurfaceResult, tracker: Tracker, covariate: Covariate | None
) -> NDArray[np.float32]:
    """The same of the vertices that were carried, by how far apart they are carried otherwise."""
    from naisr_model.surface.tracking import Tracked

    if covariate is None:
        return _along(shape.points_mm - tracker.template_points_mm, shape)
    low, high = _ends(dict(values), covariate)
    here = Tracked(shape.points_mm, shape.normals, 0.0, False)  # which is nearly there
    before, after = (tracker.track({**dict(values), covariate.name: end}, here) for end in (low, high))
    apart = 1.0 if covariate.kind == "binary" else high - low
    return _along((after.points_mm - before.points_mm) / np.float32(apart), shape)


def _ends(values: dict[str, float], covariate: Covariate) -> tuple[float, float]:
    """Where a difference is taken: between the levels, or about the present value."""
    if covariate.kind == "binary":
        return covariate.range
    (low, high), here = covariate.range, values.get(covariate.name, covariate.centre)
    step = STEP * (high - low)
    return max(low, here - step), min(high, here + step)


def _along(moved_mm: NDArray[np.float32], shape: SurfaceResult) -> NDArray[np.float32]:
    along: NDArray[np.float32] = np.sum(moved_mm * shape.normals, axis=1)
    return along


def _limit(atlas: Atlas, covariate: Covariate | None) -> float:
    """The end of the colour scale: of a rate so that over the observed range it is that of displacements."""
    limit = limit_mm(atlas, SHARE)
    if covariate is None:
        return limit
    low, high = covariate.range
    return rounded(limit / 4 if covariate.kind == "binary" else 2 * limit / (high - low))
