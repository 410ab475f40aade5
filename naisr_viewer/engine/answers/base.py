"""How the request of a view is answered: what an answer is, and what it may ask in turn."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from naisr_model.progress import Progress
from naisr_viewer.engine.maps import coloured
from naisr_viewer.engine.people import FittedPerson
from naisr_viewer.engine.previews import Previews
from naisr_viewer.engine.surfaces import deviation_mm, from_shape
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.layouts import FULL_SHAPE, TEMPLATE, Panel
from naisr_viewer.state.requests import EXACT_RESOLUTION, SurfaceRequest, SurfaceResult

if TYPE_CHECKING:
    from naisr_model.atlas import Atlas
    from naisr_model.measures.curves import Gauge
    from naisr_model.measures.norms import Norms
    from naisr_model.shapes.kinds import Shape
    from naisr_model.surface.tracking import Tracker

    Make = Callable[[Atlas, SurfaceRequest, NDArray[np.float64] | None, Tracker | None, Progress], Shape]
    """What the networks have at the values of a request, for a code (None for the average's); a tracker
    tells them where to look first."""


class Who(NamedTuple):
    """Whom a request is about.

    Attributes:
        card: of the open atlas.
        fitted: who was fitted; None for the population average.
        tracker: what carries the template for that person; None as long as previews are not prepared.
    """

    card: AtlasCard
    fitted: FittedPerson | None
    tracker: Tracker | None


class Source(Protocol):
    """What an answer may ask; :class:`~naisr_viewer.engine.engine.Engine` is one."""

    @property
    def previews(self) -> Previews:
        """Where each sub-plot's preview was left."""

    def atlas(self, path: Path) -> Atlas:
        """The networks of an open atlas."""

    def gauge(self, path: Path) -> Gauge:
        """What measures the shapes of an open atlas."""

    def known_norms(self, path: Path) -> Norms | None:
        """What is usual among the people of an open atlas, as far as it is known."""

    def who(self, path: Path, person: int) -> Who:
        """Whom a request is about."""

    def surface(self, request: SurfaceRequest, progress: Progress) -> SurfaceResult:
        """The answer to another request."""

    def prepare_previews(self, path: Path, person: int, progress: Progress) -> None:
        """Make previews of a person fast."""


@dataclass(frozen=True)
class Answer:
    """How requests for one kind of view are answered.

    Attributes:
        give: the result, whose request is the one that was asked; raises ``Cancelled`` when nobody waits.
        question: the request that is answered and remembered for one that shares its answer; itself when
            left out.
        is_kept_coarse: whether a coarse answer of the networks is complete, so that it is remembered as an
            exact one is.
    """

    give: Callable[[Source, SurfaceRequest, Progress], SurfaceResult]
    question: Callable[[SurfaceRequest, AtlasCard], SurfaceRequest] = lambda request, _: request
    is_kept_coarse: bool = False


def field_of_the_model(make: Make) -> Answer:
    """The surface of Phi, of a Phi_i or of T: from the tables while it moves, from the networks at rest.

    A person's has the margin of its extent at rest, and where there was a preview, how far off that was.
    Requests with one and the same surface share an answer, see :func:`simplest`.
    """

    def give(source: Source, request: SurfaceRequest, progress: Progress) -> SurfaceResult:
        if request.map is not None:
            return _mapped(source, request, progress)
        _, fitted, tracker = source.who(request.atlas, request.person)
        if tracker is not None and request.resolution < EXACT_RESOLUTION:
            return source.previews.surface(request, tracker)
        atlas, start = source.atlas(request.atlas), time.perf_counter()
        latent = _latent(fitted, request)
        mesh = make(atlas, request, latent, tracker, progress)
        progress.check()
        result = from_shape(request, mesh, atlas.frame, start)
        if fitted is not None and result.is_exact:
            margin = fitted.at(request.values).extent_margin(mesh)
            result = replace(result, extent_margin=margin)
        if tracker is not None and len(result.faces):
            error_mm = deviation_mm(source.previews.track(request, tracker).points_mm, result)
            result = replace(result, preview_error_mm=error_mm)
        return result

    return Answer(give, simplest, is_kept_coarse=True)


def _mapped(source: Source, request: SurfaceRequest, progress: Progress) -> SurfaceResult:
    """The plain surface, with the map that is asked for."""
    shape = source.surface(replace(request, map=None), progress.part(0.0, 0.6))
    progress.check()
    _, fitted, tracker = source.who(request.atlas, request.person)
    return coloured(request, shape, source.atlas(request.atlas), _latent(fitted, request), tracker)


def _latent(fitted: FittedPerson | None, request: SurfaceRequest) -> NDArray[np.float64] | None:
    return None if fitted is None else fitted.at(request.values).latent


def simplest(request: SurfaceRequest, atlas: AtlasCard) -> SurfaceRequest:
    """The request with the fewest covariates that has the same surface as ``request``.

    g_i vanishes where covariate i is at its centre, so Phi with a single covariate off its centre is
    that covariate's Phi_i, and with none it is the template T, whoever it is. Of shape models that know no
    Phi_i, or where g_i does not vanish, nothing of the kind is known.
    """
    if not (atlas.capabilities.vanishes_at_centre and atlas.capabilities.disentangleable):
        return request
    centre = {covariate.name: covariate.centre for covariate in atlas.covariates}
    moved = tuple((name, value) for name, value in request.values if value != centre[name])
    if len(moved) > 1:
        return replace(request, panel=FULL_SHAPE, values=moved)
    if moved:
        return replace(request, panel=Panel("effect", moved[0][0]), values=moved)
    return replace(request, panel=TEMPLATE, values=(), person=0)
