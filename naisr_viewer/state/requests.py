"""What is asked of the engine and what comes back; a request holds all it needs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import Enum, auto
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from naisr_viewer.state.explorer import (
    FULL_SHAPE,
    TEMPLATE,
    Covariate,
    ExplorerState,
    Panel,
    panel_values,
    visible_panels,
)
from naisr_viewer.state.patients import Named

PREVIEW_RESOLUTION = 40
"""Cells along a side of the box while a slider moves and displacements are not tabulated yet."""

EXACT_RESOLUTION = 128
"""Cells along a side of the box at rest; also the density of a preview by tabulated displacements."""

FORMATS = ("stl", "ply", "obj", "vtp", "glb")
"""Mesh files that can be written."""

HAS_TWO_SIDES = {"scan": True, "certainty": False, "change": True}
"""Kinds of panels with numbers on their surface, and whether the scale of these has two sides."""

Progress = Callable[[float], None]
"""Told now and then which share of the work is done, 0 to 1."""

ShouldStop = Callable[[], bool]
"""Asked now and then whether nobody waits for the work any more."""


class Origin(Enum):
    """How a surface was found."""

    NETWORK = auto()  # the zero level set of the networks on a lattice
    TABLES = auto()  # the template's surface, carried by tabulated displacements


@dataclass(frozen=True)
class SurfaceRequest:
    """One surface of one atlas, like a function call written down.

    Attributes:
        atlas: the file of the atlas.
        panel: which of its surfaces.
        values: the covariate values (real units) the surface depends on.
        resolution: cells along a side of the box; below :data:`EXACT_RESOLUTION` a preview is wanted.
        person: whose code; 0 for the population average.
        before: of a change, person and covariate values that it is counted from.
    """

    atlas: Path
    panel: Panel
    values: Named
    resolution: int
    person: int = 0
    before: tuple[int, Named] | None = None


@dataclass(frozen=True, eq=False)
class Colouring:
    """Values shown as colours on a surface, with a fixed scale, so that pictures can be compared.

    Attributes:
        values_mm: one a vertex, float32 ``[n]``.
        limit_mm: the end of the scale; values beyond it have its colour.
        is_signed: whether the scale runs from ``-limit_mm`` to ``limit_mm``; else it begins at 0.
    """

    values_mm: NDArray[np.float32]
    limit_mm: float
    is_signed: bool


@dataclass(frozen=True, eq=False)
class SurfaceResult:
    """A surface ready to be drawn.

    Attributes:
        request: the question this answers.
        points_mm: vertices in millimetres, float32 ``[n, 3]``.
        normals: outward unit normals at the vertices, float32 ``[n, 3]``.
        faces: vertex numbers of the triangles, int64 ``[m, 3]``; none where no surface exists.
        volume_cm3: enclosed volume.
        seconds: how long it took to compute; equal surfaces share one computation and its arrays.
        origin: how it was found.
        doubtful: the deformation folds, so that a preview may lack or invent pieces.
        preview_error_mm: of an exact surface: the distance within which 99 % of the preview's vertices
            lay; None where there was no preview by tabulated displacements.
        volume_margin_cm3: half of the volume's 95 % interval; None for the population average.
        volume_before_cm3: of a change: the volume that it is counted from.
        colouring: of a scan, a change or an uncertainty at rest; else None.
    """

    request: SurfaceRequest
    points_mm: NDArray[np.float32]
    normals: NDArray[np.float32]
    faces: NDArray[np.int64]
    volume_cm3: float
    seconds: float
    origin: Origin
    doubtful: bool = False
    preview_error_mm: float | None = None
    volume_margin_cm3: float | None = None
    volume_before_cm3: float | None = None
    colouring: Colouring | None = None

    @property
    def is_exact(self) -> bool:
        """Whether this is as fine as the window shows at rest."""
        return self.origin is Origin.NETWORK and self.request.resolution >= EXACT_RESOLUTION


def request_for(state: ExplorerState, panel: Panel, resolution: int) -> SurfaceRequest:
    """The surface that ``panel`` shows in ``state``; there is an atlas."""
    assert state.atlas is not None
    person, before, reference = state.person, None, state.reference
    if panel.kind == "template":
        person = 0
    if panel.kind == "before" and reference is not None:
        person = reference.person
    if panel.kind == "change" and reference is not None:
        before = reference.person, reference.values
    values = panel_values(state, panel)
    return SurfaceRequest(state.atlas.path, panel, values, resolution, person, before)


def template_request(atlas: Path) -> SurfaceRequest:
    """The exact template, which all previews are made of."""
    return SurfaceRequest(atlas, TEMPLATE, (), EXACT_RESOLUTION)


def simplest(request: SurfaceRequest, covariates: tuple[Covariate, ...]) -> SurfaceRequest:
    """The request with the fewest covariates that has the same surface as ``request``.

    g_i vanishes where covariate i is at its centre, so Phi with a single covariate off its centre is
    that covariate's Phi_i, and with none it is the template T, whoever it is.
    """
    if request.panel.kind in HAS_TWO_SIDES:
        return request
    centre = {covariate.name: covariate.centre for covariate in covariates}
    moved = tuple((name, value) for name, value in request.values if value != centre[name])
    if len(moved) > 1:
        return replace(request, panel=FULL_SHAPE, values=moved)
    if moved:
        return replace(request, panel=Panel("effect", moved[0][0]), values=moved)
    return replace(request, panel=TEMPLATE, values=(), person=0)


def answers(result: SurfaceResult | None, request: SurfaceRequest) -> bool:
    """Whether ``result`` shows what ``request`` asks for, at least as finely."""
    if result is None or result.request.resolution < request.resolution:
        return False
    return replace(result.request, resolution=request.resolution) == request


def missing(
    state: ExplorerState, shown: Mapping[Panel, SurfaceResult], resolution: int
) -> list[SurfaceRequest]:
    """What ``state`` wants at ``resolution`` and is not among ``shown`` yet, the full shape first."""
    wanted = [request_for(state, panel, resolution) for panel in reversed(visible_panels(state))]
    return [request for request in wanted if not answers(shown.get(request.panel), request)]


@dataclass(frozen=True)
class ExportChoice:
    """What to write and where.

    Attributes:
        panels: the surfaces.
        format: one of :data:`FORMATS`.
        resolution: cells along a side of the box.
        folder: made when it is missing.
    """

    panels: tuple[Panel, ...]
    format: str
    resolution: int
    folder: Path
