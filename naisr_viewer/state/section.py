"""The plane that all shapes are cut by."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from naisr_viewer.state.camera import Camera, Triple


class Plane(StrEnum):
    """Which way the plane lies."""

    SAGITTAL = "sagittal"
    CORONAL = "coronal"
    AXIAL = "axial"
    FREE = "free"


@dataclass(frozen=True)
class Section:
    """A plane ``normal . p = offset_mm``; what lies on one side of it is not shown.

    Attributes:
        plane: which way it lies.
        normal: of length 1.
        offset_mm: from the origin of the atlas's frame, along the normal.
        is_low_cut: whether what lies below the offset is taken away, else what lies above.
    """

    plane: Plane
    normal: Triple
    offset_mm: float
    is_low_cut: bool = False


@dataclass(frozen=True, eq=False)
class Cut:
    """One surface cut by the plane.

    Attributes:
        points_mm: of the outline, ``[n, 3]``.
        lines: pairs of them, ``[k, 2]``; none where the plane misses the surface.
        area_mm2: of what the outline encloses; None where the surface is open there.
    """

    points_mm: NDArray[np.float64]
    lines: NDArray[np.int64]
    area_mm2: float | None


NORMALS: dict[Plane, tuple[Triple, bool]] = {
    Plane.SAGITTAL: ((1.0, 0.0, 0.0), False),
    Plane.CORONAL: ((0.0, 1.0, 0.0), True),
    Plane.AXIAL: ((0.0, 0.0, 1.0), False),
}
"""x points left, y back, z up; and whether the low side is taken away first: left, front and top are."""


def facing(camera: Camera | None) -> Triple:
    """The direction towards the eye, of length 1; from the front where there is none yet."""
    if camera is None:
        return (0.0, -1.0, 0.0)
    towards = np.subtract(camera.position_mm, camera.focus_mm)
    x, y, z = (towards / np.linalg.norm(towards)).tolist()
    return x, y, z


def section_of(plane: Plane, towards: Triple, middle_mm: Triple) -> Section:
    """A plane through a point.

    Args:
        plane: which way it lies.
        towards: the normal of a free one, of length 1.
        middle_mm: the point.
    """
    normal, is_low_cut = NORMALS.get(plane, (towards, False))
    return Section(plane, normal, round(float(np.dot(normal, middle_mm)), 1), is_low_cut)
