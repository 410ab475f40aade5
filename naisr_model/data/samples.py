"""Signed distances and surface samples of one shape, in model units."""

from __future__ import annotations

from dataclasses import dataclass

import igl
import numpy as np
import trimesh
from numpy.typing import NDArray

from naisr_model.frames import Frame

NEAR_SIGMAS = (0.05, 0.0158)
"""Standard deviations in model units of the offsets from the surface, half of the samples each.

The square roots of the two variances in the DeepSDF paper (0.0025 and 0.00025).
"""


@dataclass(frozen=True, eq=False)
class ShapeSamples:
    """Samples of one shape in model units, float32, in random order.

    Attributes:
        surface: points on the surface and their outward unit normals, ``[n_surface, 2 * dim]``.
        near: points around the surface and their signed distances, ``[n_near, dim + 1]``.
        uniform: the same for points spread evenly over the box ``[-1, 1]^dim``, ``[n_uniform, dim + 1]``.
    """

    surface: NDArray[np.float32]
    near: NDArray[np.float32]
    uniform: NDArray[np.float32]


def signed_distance(mesh: trimesh.Trimesh, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance to ``mesh``, negative inside; mesh and points share any one unit, ``[n, 3] -> [n]``.

    The magnitude is the exact distance to the triangles. The sign is that of the generalised
    winding number minus one half, which a hole in the surface changes only close to the hole
    (Barill et al. 2018, Fast winding numbers for soups and clouds).
    """
    vertices = np.ascontiguousarray(mesh.vertices, dtype=np.float64)
    faces = np.ascontiguousarray(mesh.faces, dtype=np.int64)
    points = np.ascontiguousarray(points, dtype=np.float64)
    squared, _, _ = igl.point_mesh_squared_distance(points, vertices, faces)
    inside = igl.fast_winding_number(vertices, faces, points) > 0.5
    return np.where(inside, -1.0, 1.0) * np.sqrt(np.maximum(squared, 0.0))


def sample_shape(
    mesh_mm: trimesh.Trimesh, frame: Frame, n_surface: int, n_near: int, n_uniform: int, seed: int
) -> ShapeSamples:
    """Sample one aligned, outward-facing mesh.

    Args:
        mesh_mm: the surface in millimetres of the aligned frame.
        frame: millimetres to model units.
        n_surface: points on the surface.
        n_near: signed distances around the surface.
        n_uniform: signed distances evenly over the box.
        seed: the same seed gives the same samples.
    """
    rng = np.random.default_rng(seed)
    mesh = trimesh.Trimesh(frame.to_model(mesh_mm.vertices), mesh_mm.faces, process=False)
    surface = np.concatenate(_surface_points(mesh, n_surface, rng), axis=1)
    near = _surface_points(mesh, n_near, rng)[0]
    sigma = rng.choice(NEAR_SIGMAS, size=(n_near, 1))
    near += sigma * rng.standard_normal(near.shape)
    uniform = rng.uniform(-1.0, 1.0, size=(n_uniform, frame.dim))
    distances = signed_distance(mesh, np.concatenate([near, uniform]))[:, None]
    return ShapeSamples(
        surface=surface.astype(np.float32),
        near=np.hstack([near, distances[:n_near]]).astype(np.float32),
        uniform=np.hstack([uniform, distances[n_near:]]).astype(np.float32),
    )


def _surface_points(
    mesh: trimesh.Trimesh, count: int, rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
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
