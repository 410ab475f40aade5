"""Zero level set of node values as a surface or a curve in millimetres."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from naisr_model.frames import Frame
from naisr_model.shapes.curve import closed
from naisr_model.shapes.kinds import KINDS, Shape
from naisr_model.surface.lattice import Lattice

FAR = 1e6
"""Model units that stand for infinity."""


def isosurface(values: NDArray[np.float32], lattice: Lattice, frame: Frame) -> Shape:
    """The surface, or the curve, where ``values`` change sign, faces outward (values are negative inside).

    Args:
        values: at the lattice's nodes, shape ``lattice.shape``.
        lattice: where the values are.
        frame: to millimetres.

    Returns:
        A shape in millimetres; without faces where the values never change sign.
    """
    points, faces = _LEVELS[lattice.dim](values, lattice)
    return KINDS[lattice.dim].made(frame.to_mm(points), faces)


def _surface(
    values: NDArray[np.float32], lattice: Lattice
) -> tuple[NDArray[np.floating], NDArray[np.integer]]:
    """By flying edges."""
    grid = pv.ImageData(
        dimensions=lattice.shape[::-1], spacing=(lattice.spacing,) * 3, origin=(-1.0, -1.0, -1.0)
    )
    grid["sdf"] = values.ravel()
    surface = grid.contour([0.0], scalars="sdf", method="flying_edges", compute_normals=False)
    # Fields that grow outwards come out of VTK with inward faces.
    return surface.points, surface.regular_faces[:, ::-1] if surface.n_cells else np.empty((0, 3), int)


def _curve(values: NDArray[np.float32], lattice: Lattice) -> tuple[NDArray[np.floating], NDArray[np.integer]]:
    """By marching squares; a curve that leaves the box is closed along its rim."""
    from skimage.measure import find_contours  # takes a second

    if np.isnan(values).any():
        return np.full((1, 2), np.nan), np.empty((0, 2), int)
    known = np.clip(values.astype(np.float64), -FAR, FAR)
    loops = find_contours(np.pad(known, 1, constant_values=FAR), 0.0)
    # Of a node in the padded array: its column and row are one more than the lattice's x and y.
    found = closed([(loop[:-1, ::-1] - 1) * lattice.spacing - 1 for loop in loops if len(loop) > 3])
    return found.vertices, found.faces


_LEVELS = {2: _curve, 3: _surface}
