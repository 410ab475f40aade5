"""The outside of surfaces that overlap, lie in each other or are double: one closed surface around them all.

A point is inside where the generalised winding number is above one half (Jacobson et al. 2013), whatever
number of pieces it is in. The signed distance to the faces, sampled where it is small, gives the surface by
marching cubes.
"""

from __future__ import annotations

import igl
import numpy as np
import trimesh
from numpy.typing import NDArray

from naisr_model.errors import InputError

CELLS = 128
"""Along the longest side; the surface lies within a small part of a cell of where it should."""

MOST_NEAR = 0.4
"""Share of the lattice's nodes that may lie near a face; of sound surfaces a tenth do."""

_BLOCK = 4


def outside(mesh: trimesh.Trimesh) -> tuple[trimesh.Trimesh, float]:
    """The surface around all that a mesh encloses, and the side of its lattice's cells, in the mesh's unit.

    Args:
        mesh: a closed surface or several, faces outward.

    Raises:
        InputError: when the faces fill most of space, as those of a damaged file do.
    """
    vertices = np.ascontiguousarray(mesh.vertices, np.float64)
    faces = np.ascontiguousarray(mesh.faces, np.int64)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    side = float((high - low).max()) / CELLS
    blocks = np.ceil((high - low) / (side * _BLOCK)).astype(np.int64) + 2
    # Moved by no simple fraction of a cell, so that faces along the lattice fall between its nodes.
    origin = low - side * _BLOCK * (1 - 1 / np.pi)
    values = _far_values(vertices, faces, origin, side, blocks)
    near = np.argwhere(np.isnan(values))
    if len(near) > MOST_NEAR * values.size:
        raise InputError(
            "the faces cross each other all over the shape, so it has no outside; export it again"
        )
    values[tuple(near.T)] = _signed_distances(vertices, faces, origin + near * side)
    return _contour(values, origin, side), side


def _far_values(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    origin: NDArray[np.float64],
    side: float,
    blocks: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Node values of blocks that no face comes near: the distance at their middle; NaN of the others."""
    index = np.stack(np.meshgrid(*map(np.arange, blocks), indexing="ij"), axis=-1).reshape(-1, 3)
    middles = origin + side * _BLOCK * (index + 0.5)
    distances = _signed_distances(vertices, faces, middles)
    reach = side * _BLOCK * np.sqrt(3) / 2
    of_block = np.where(np.abs(distances) <= 1.01 * reach, np.nan, distances).reshape(blocks)
    values = np.full(blocks * _BLOCK + 1, 0.0)
    shape = tuple(slice(0, count * _BLOCK) for count in blocks)
    values[shape] = of_block.repeat(_BLOCK, 0).repeat(_BLOCK, 1).repeat(_BLOCK, 2)
    for axis in range(3):  # the nodes at the far ends belong to the last blocks
        end = [slice(None)] * 3
        end[axis] = slice(-1, None)
        last = [slice(None)] * 3
        last[axis] = slice(-2, -1)
        values[tuple(end)] = values[tuple(last)]
    return values


def _signed_distances(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    points = np.ascontiguousarray(points)
    squared, _, _ = igl.point_mesh_squared_distance(points, vertices, faces)
    inside = igl.fast_winding_number(vertices, faces, points) > 0.5
    return np.where(inside, -1.0, 1.0) * np.sqrt(np.maximum(squared, 0.0))


def _contour(values: NDArray[np.float64], origin: NDArray[np.float64], side: float) -> trimesh.Trimesh:
    import pyvista

    image = pyvista.ImageData(dimensions=values.shape, spacing=(side, side, side), origin=tuple(origin))
    # Of a value that is 0 the contour would make faces without area.
    level = np.where(np.abs(values) < 1e-9 * side, 1e-9 * side, values)
    image.point_data["distance"] = level.ravel(order="F")
    surface = image.contour([0.0], scalars="distance", method="flying_edges")
    triangles = np.asarray(surface.regular_faces, np.int64).reshape(-1, 3)
    # Of values that are negative inside, the triangles look inward.
    return trimesh.Trimesh(np.asarray(surface.points, np.float64), triangles[:, ::-1], process=False)
