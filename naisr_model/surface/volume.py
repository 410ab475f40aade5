"""What lies inside a smooth surface or curve, from the triangles or segments that approximate it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from naisr_model.shapes.curve import enclosed_area
from naisr_model.shapes.kinds import Shape, kind_of

EDGES = ((0, 1), (1, 2), (2, 0))
"""Corners of a triangle that its sides join."""


def enclosed_volume(
    points: NDArray[np.floating], normals: NDArray[np.floating], faces: NDArray[np.integer]
) -> float:
    """Volume inside the smooth closed surface through ``points``, in their unit cubed.

    The triangles alone lie inside a convex surface: of a tube three voxels wide they lose some per cent.
    So each is taken for a quadratic patch. A side from a to b with normals n_a and n_b is an arc whose
    middle stands (n_b - n_a) . (b - a) / 8 above the chord, and a triangle of area A then holds a third of
    A times the sum of its three sags more than the flat one (the divergence theorem gives that one).

    Args:
        points: vertices, ``[n, 3]``.
        normals: outward unit normals there, ``[n, 3]``.
        faces: vertex numbers of the triangles, outward by the right hand, ``[m, 3]``.
    """
    corners = points.astype(np.float64)[faces]
    directions = normals.astype(np.float64)[faces]
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    flat = np.einsum("ij,ij->", a, np.cross(b, c)) / 6
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    sags = sum(
        np.einsum("ij,ij->i", directions[:, j] - directions[:, i], corners[:, j] - corners[:, i]) / 8
        for i, j in EDGES
    )
    return float(flat + (areas * sags).sum() / 3)


def enclosed(shape: Shape) -> float:
    """Volume inside the smooth surface, or area inside the smooth curve, through the vertices of a shape."""
    return _ENCLOSED[kind_of(shape).dim](shape)


_ENCLOSED = {
    2: enclosed_area,
    3: lambda mesh: enclosed_volume(mesh.vertices, mesh.vertex_normals, mesh.faces),
}
