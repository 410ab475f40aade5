"""Surfaces as the bytes of a mesh file, each format by its own convention, and what curves are written as.

STL, PLY, OBJ and VTP hold millimetres in the frame of the atlas, z up. GLB holds metres with y up, as glTF
2.0 says ("Coordinate System and Units"), so that other programs show it upright and in its size.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from naisr_model.errors import InputError

if TYPE_CHECKING:
    import trimesh

MeshFormat = Literal["stl", "ply", "obj", "vtp", "glb"]
FORMATS: tuple[MeshFormat, ...] = ("stl", "ply", "obj", "vtp", "glb")
"""The formats of surfaces that are written, by their endings."""

CURVE_FORMATS = ("svg", "csv")
"""Those of curves in the plane."""

GLB_TO_MM: NDArray[np.float64] = np.array(
    [[1000.0, 0, 0, 0], [0, 0, -1000.0, 0], [0, 1000.0, 0, 0], [0, 0, 0, 1.0]]
)
"""4x4, metres with y up to millimetres with z up: ``(x, y, z) -> 1000 (x, -z, y)``."""


def format_named(path: Path) -> MeshFormat | None:
    """The format that the ending of a file asks for; None where it is none of them."""
    return next((each for each in FORMATS if path.suffix.lower() == f".{each}"), None)


def require_format(path: Path, dim: int | None = None) -> str:
    """The ending of a file, known to be one of a surface or a curve.

    Args:
        path: of the file.
        dim: 2 for a curve, 3 for a surface; None where that is not known yet.

    Raises:
        InputError: when it is none of them.
    """
    ending = path.suffix.lower().removeprefix(".")
    formats = {2: CURVE_FORMATS, 3: FORMATS, None: (*FORMATS, *CURVE_FORMATS)}[dim]
    if ending in formats:
        return ending
    *others, last = (f".{each}" for each in (CURVE_FORMATS if dim == 2 else FORMATS))
    raise InputError(f"cannot write '{path.suffix}'; name the file {', '.join(others)} or {last}")


def mesh_bytes(mesh_mm: trimesh.Trimesh, ending: MeshFormat) -> bytes:
    """A surface in millimetres, z up, as the content of a file; PLY and VTP hold its vertex attributes."""
    if ending == "vtp":
        return _vtp(mesh_mm)
    if ending == "glb":
        mesh_mm = mesh_mm.copy()
        mesh_mm.apply_transform(np.linalg.inv(GLB_TO_MM))
    content = mesh_mm.export(file_type=ending)
    return content.encode() if isinstance(content, str) else bytes(content)


def _vtp(mesh_mm: trimesh.Trimesh) -> bytes:
    """Written to memory: VTK ends the whole process where a disk is full."""
    import pyvista
    from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

    points_mm = np.asarray(mesh_mm.vertices, np.float32)
    surface = pyvista.PolyData(points_mm)
    if len(mesh_mm.faces):
        surface = pyvista.PolyData.from_regular_faces(points_mm, mesh_mm.faces)
        surface.point_data.active_normals = np.asarray(mesh_mm.vertex_normals, np.float32)
    for name, numbers in mesh_mm.vertex_attributes.items():
        surface.point_data[name] = numbers
    writer = vtkXMLPolyDataWriter()
    writer.SetInputData(surface)
    writer.SetDataModeToBinary()
    writer.WriteToOutputStringOn()
    writer.Write()
    return str(writer.GetOutputString()).encode()
