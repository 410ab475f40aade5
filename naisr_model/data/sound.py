"""A shape of either kind from a user's file, set right where that can be done, refused where it cannot."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, NamedTuple

from naisr_model.data import curves, meshes
from naisr_model.data.remarks import Remark
from naisr_model.shapes.kinds import Shape, kind_of


class ShapeFile(NamedTuple):
    """What was read from the file of a shape.

    Attributes:
        shape_mm: a surface, or a curve in the unit that was read.
        space: ``LPS`` or ``RAS`` where the file of a surface says it, else empty.
        remarks: what is odd about the file, and what was repaired.
    """

    shape_mm: Shape
    space: Literal["LPS", "RAS", ""]
    remarks: tuple[Remark, ...]


def sound_shape(path: Path) -> ShapeFile:
    """Read a surface or a curve, set right what can be set right, and refuse what bounds nothing.

    Raises:
        InputError: as :func:`~.meshes.sound_mesh` and :func:`~.curves.sound_curve`.
    """
    if curves.is_curve_file(path):
        drawn = curves.sound_curve(path)
        return ShapeFile(drawn.curve, "", drawn.remarks)
    file = meshes.sound_mesh(path)
    return ShapeFile(file.mesh_mm, file.space, file.remarks)


def is_closed(shape: Shape) -> bool:
    """Whether a shape bounds something, so that what it encloses means something."""
    return _IS_CLOSED[kind_of(shape).dim](shape)


_IS_CLOSED = {2: lambda curve: bool(len(curve.faces)), 3: meshes.is_closed}
