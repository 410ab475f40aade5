"""Signed distances and surface samples of one shape, in model units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from naisr_model.frames import Frame
from naisr_model.shapes.kinds import Shape, kind_of

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


def signed_distance(shape: Shape, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Exact distance to ``shape``, negative inside; both share any one unit, ``[n, dim] -> [n]``."""
    return kind_of(shape).distances(shape, points)


def sample_shape(
    mesh_mm: Shape, frame: Frame, n_surface: int, n_near: int, n_uniform: int, seed: int
) -> ShapeSamples:
    """Sample one aligned, outward-facing shape.

    Args:
        mesh_mm: the surface, or the curve, in millimetres of the aligned frame.
        frame: millimetres to model units.
        n_surface: points on the surface.
        n_near: signed distances around the surface.
        n_uniform: signed distances evenly over the box.
        seed: the same seed gives the same samples.
    """
    rng = np.random.default_rng(seed)
    kind = kind_of(mesh_mm)
    shape = kind.made(frame.to_model(mesh_mm.vertices), mesh_mm.faces)
    surface = np.concatenate(kind.sampled(shape, n_surface, rng), axis=1)
    near = kind.sampled(shape, n_near, rng)[0]
    sigma = rng.choice(NEAR_SIGMAS, size=(n_near, 1))
    near += sigma * rng.standard_normal(near.shape)
    uniform = rng.uniform(-1.0, 1.0, size=(n_uniform, frame.dim))
    distances = kind.distances(shape, np.concatenate([near, uniform]))[:, None]
    return ShapeSamples(
        surface=surface.astype(np.float32),
        near=np.hstack([near, distances[:n_near]]).astype(np.float32),
        uniform=np.hstack([uniform, distances[n_near:]]).astype(np.float32),
    )
