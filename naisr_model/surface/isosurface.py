"""Zero level set of node values as a mesh in millimetres."""

from __future__ import annotations

import numpy as np
import pyvista as pv
import trimesh
from numpy.typing import NDArray

from naisr_model.frames import Frame
from naisr_model.surface.lattice import Lattice


def isosurface(values: NDArray[np.float32], lattice: Lattice, frame: Frame) -> trimesh.Trimesh:
    """The surface where ``values`` change sign, faces outward (values are negative inside).

    Args:
        values: at the lattice's nodes, shape ``lattice.shape``.
        lattice: where the values are.
        frame: to millimetres.

    Returns:
        A mesh in millimetres; without faces where the values never change sign.
    """
    grid = pv.ImageData(
        dimensions=lattice.shape[::-1], spacing=(lattice.spacing,) * 3, origin=(-1.0, -1.0, -1.0)
    )
    grid["sdf"] = values.ravel()
    surface = grid.contour([0.0], scalars="sdf", method="flying_edges", compute_normals=False)
    # Fields that grow outwards come out of VTK with inward faces.
    faces = surface.regular_faces[:, ::-1] if surface.n_cells else np.empty((0, 3), int)
    return trimesh.Trimesh(frame.to_mm(surface.points), faces, process=False)
