"""What is asked of the engine and what comes back; a request holds all it needs."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from naisr_viewer.state.camera import FROM_THE_FRONT, Camera
from naisr_viewer.state.layouts import Panel
from naisr_viewer.state.overlay import Map
from naisr_viewer.state.patients import Named

PREVIEW_RESOLUTION = 40
"""Cells along a side of the box while a slider moves and displacements are not tabulated yet."""

EXACT_RESOLUTION = 128
"""Cells along a side of the box at rest; also the density of a preview by tabulated displacements."""

Scale = Literal["signed", "unsigned"]
"""Of numbers shown as colours: from minus to plus a limit, or from 0 to it."""


class Origin(Enum):
    """How a surface was found."""

    NETWORK = auto()  # the zero level set of the networks on a lattice
    TABLES = auto()  # the template's surface, carried by tabulated displacements
    MEASURED = auto()  # a scan


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
        map: what is shown on it, point by point; None for nothing.
        is_judged: whether it is compared with what is usual, which is known then.
    """

    atlas: Path
    panel: Panel
    values: Named
    resolution: int
    person: int = 0
    before: tuple[int, Named] | None = None
    map: Map | None = None
    is_judged: bool = False


@dataclass(frozen=True, eq=False)
class Colouring:
    """Values shown as colours on a surface, with a fixed scale, so that pictures can be compared.

    Attributes:
        values: one a vertex in the unit of the kind of view, float32 ``[n]``.
        limit: the end of the scale; values beyond it have its colour.
        scale: from ``-limit`` to ``limit``, or from 0.
    """

    values: NDArray[np.float32]
    limit: float
    scale: Scale


@dataclass(frozen=True, eq=False)
class SurfaceResult:
    """A surface, or a curve in the plane, ready to be drawn.

    Attributes:
        request: the question this answers.
        points_mm: vertices in millimetres or the unit of the atlas's frame, float32 ``[n, dim]``.
        normals: outward unit normals at the vertices, float32 ``[n, dim]``.
        faces: vertex numbers of the triangles, or of the segments of a curve, int64 ``[m, dim]``; none where
            there is no surface.
        extent: what it encloses, a volume or an area, in the unit of the atlas's extent.
        seconds: how long it took to compute; equal surfaces share one computation and its arrays.
        origin: how it was found.
        doubtful: the deformation folds, so that a preview may lack or invent pieces.
        preview_error_mm: of an exact surface: the distance within which 99 % of the preview's vertices
            lay; None where there was no preview by tabulated displacements.
        extent_margin: half of its 95 % interval; None for the population average.
        extent_before: of a change: the extent that it is counted from.
        unexpressed: of a scan: share of it that the atlas cannot express; None where that is not asked.
        colouring: of a kind of view with numbers on its surface, at rest; else None.
    """

    request: SurfaceRequest
    points_mm: NDArray[np.float32]
    normals: NDArray[np.float32]
    faces: NDArray[np.int64]
    extent: float
    seconds: float
    origin: Origin
    doubtful: bool = False
    preview_error_mm: float | None = None
    extent_margin: float | None = None
    extent_before: float | None = None
    unexpressed: float | None = None
    colouring: Colouring | None = None

    @property
    def dim(self) -> int:
        """3 for a surface, 2 for a curve."""
        return self.points_mm.shape[1]

    @property
    def is_exact(self) -> bool:
        """Whether this is as fine as the window shows at rest."""
        return self.origin is not Origin.TABLES and self.request.resolution >= EXACT_RESOLUTION


@dataclass(frozen=True)
class ExportChoice:
    """What to write and where.

    Attributes:
        panels: the surfaces.
        format: of surfaces one of :data:`~naisr_model.exports.FORMATS`, of curves of its sister.
        resolution: cells along a side of the box.
        folder: made when it is missing.
        figure: ``pdf`` or ``svg`` where the panels are the matrix, whose files have a folder of their own in
            that folder; empty for surfaces alone.
        camera: from where a figure is seen.
    """

    panels: tuple[Panel, ...]
    format: str
    resolution: int
    folder: Path
    figure: str = ""
    camera: Camera = FROM_THE_FRONT
