"""The one place that knows what a shape is in the plane and in space.

Everything else asks :func:`kind_of` a shape, or :data:`KINDS` by the number of dimensions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO, StringIO
from typing import Any

import igl
import numpy as np
import trimesh
from numpy.typing import NDArray

from naisr_model.shapes.curve import Curve, closed
from naisr_model.shapes.written import csv_bytes

Shape = trimesh.Trimesh | Any
"""A ``trimesh.Trimesh`` of a 3D atlas, a :class:`Curve` of a 2D one. Whoever holds an atlas knows which of
the two it is, so the type checker lets it pass for either."""

SHAPES = (trimesh.Trimesh, Curve)
"""The classes of shapes."""

Points = NDArray[np.float64]


@dataclass(frozen=True)
class Kind:
    """What can be asked of shapes of one number of dimensions.

    Attributes:
        dim: 2 or 3.
        noun: what a shape is called in a table.
        plural: what several are called.
        stored: name of its file in a store.
        made: of vertices ``[n, dim]`` and faces ``[m, dim]``.
        sampled: points spread evenly over it and the outward unit normals there, ``[n, dim]`` each.
        parts: sizes of the faces, ``[m]``, and their middles, ``[m, dim]``.
        distances: exact signed distances of points ``[n, dim]``, negative inside, ``[n]``.
        pieces: parts that share no vertex; 0 where there is nothing.
        written: as the content of its file in a store.
        read: the shape of such a content; raises whatever it likes where that is damaged.
    """

    dim: int
    noun: str
    plural: str
    stored: str
    made: Callable[[Points, NDArray[np.integer]], Shape]
    sampled: Callable[[Any, int, np.random.Generator], tuple[Points, Points]]
    parts: Callable[[Any], tuple[Points, Points]]
    distances: Callable[[Any, Points], Points]
    pieces: Callable[[Any], int]
    written: Callable[[Any], bytes]
    read: Callable[[bytes], Shape]


def kind_of(shape: Shape) -> Kind:
    """The kind of a shape."""
    return KINDS[np.shape(shape.vertices)[1]]


# --- surfaces in space ----------------------------------------------------------------------------


def _surface_points(mesh: trimesh.Trimesh, count: int, rng: np.random.Generator) -> tuple[Points, Points]:
    """Points spread evenly by area and the normals of their faces, ``[count, 3]`` each."""
    corners = np.asarray(mesh.vertices)[np.asarray(mesh.faces)]
    area_vectors = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice_area = np.linalg.norm(area_vectors, axis=1)
    chosen = rng.choice(len(corners), size=count, p=twice_area / twice_area.sum())
    # Folding the unit square along its diagonal makes two uniform numbers uniform in the triangle.
    weights = rng.random((count, 2))
    weights = np.where(weights.sum(axis=1, keepdims=True) > 1, 1 - weights, weights)
    edges = corners[chosen, 1:] - corners[chosen, :1]
    points = corners[chosen, 0] + np.einsum("nk,nkd->nd", weights, edges)
    return points, area_vectors[chosen] / twice_area[chosen, None]


def _surface_distances(mesh: trimesh.Trimesh, points: Points) -> Points:
    """Distances to the triangles.

    The sign is that of the generalised winding number minus one half, which a hole in the surface changes
    only close to the hole (Barill et al. 2018, Fast winding numbers for soups and clouds).
    """
    vertices = np.ascontiguousarray(mesh.vertices, dtype=np.float64)
    faces = np.ascontiguousarray(mesh.faces, dtype=np.int64)
    points = np.ascontiguousarray(points, dtype=np.float64)
    squared, _, _ = igl.point_mesh_squared_distance(points, vertices, faces)
    inside = igl.fast_winding_number(vertices, faces, points) > 0.5
    return np.where(inside, -1.0, 1.0) * np.sqrt(np.maximum(squared, 0.0))


def _surface_pieces(mesh: trimesh.Trimesh) -> int:
    return int(igl.facet_components(np.asarray(mesh.faces))[0]) if len(mesh.faces) else 0


def _ply(mesh: trimesh.Trimesh) -> bytes:
    content = BytesIO()
    mesh.export(content, file_type="ply")
    return content.getvalue()


# --- curves in the plane --------------------------------------------------------------------------


def _read_curve(content: bytes) -> Curve:
    """Of what :func:`csv_bytes` gave."""
    rows = np.loadtxt(StringIO(content.decode()), delimiter=",", skiprows=1, ndmin=2)
    return closed([rows[rows[:, 2] == piece, :2] for piece in np.unique(rows[:, 2])])


KINDS = {
    2: Kind(
        2,
        "curve",
        "curves",
        "curve.csv",
        lambda vertices, faces: Curve(np.asarray(vertices), np.asarray(faces, np.int64)),
        Curve.sampled,
        lambda curve: (curve.lengths, curve.vertices[curve.faces].mean(axis=1)),
        Curve.signed_distance,
        lambda curve: int(curve.pieces),
        csv_bytes,
        _read_curve,
    ),
    3: Kind(
        3,
        "mesh",
        "meshes",
        "mesh.ply",
        lambda vertices, faces: trimesh.Trimesh(vertices, faces, process=False),
        _surface_points,
        lambda mesh: (np.asarray(mesh.area_faces), np.asarray(mesh.triangles_center)),
        _surface_distances,
        _surface_pieces,
        _ply,
        lambda content: trimesh.load_mesh(BytesIO(content), file_type="ply", process=False),
    ),
}
"""By the number of dimensions."""
