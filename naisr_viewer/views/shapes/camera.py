"""Where the camera stands and what it sees; known before anything can draw."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pyvista as pv

Direction = tuple[float, float, float]

DIRECTIONS: dict[str, tuple[Direction, Direction]] = {
    "the front": ((0, -1, 0), (0, 0, 1)),
    "the back": ((0, 1, 0), (0, 0, 1)),
    "the left": ((1, 0, 0), (0, 0, 1)),
    "the right": ((-1, 0, 0), (0, 0, 1)),
    "above": ((0, 0, 1), (0, -1, 0)),
    "below": ((0, 0, -1), (0, -1, 0)),
}
"""Side of the body the camera stands at, and which way is up; x points left, y back, z up."""

OBLIQUE = ((0.9, -0.45, 0.15), (0.0, 0.0, 1.0))
"""The view an atlas opens with: from the left and a little from the front."""


def aim(camera: pv.Camera, box_mm: NDArray[np.float64]) -> None:
    """Look at the middle of a box ``[3, 2]`` from well outside, keeping the direction."""
    direction = np.subtract(camera.position, camera.focal_point)
    distance = 3 * np.linalg.norm(box_mm[:, 1] - box_mm[:, 0])
    centre = box_mm.mean(axis=1)
    camera.position = centre + direction / np.linalg.norm(direction) * distance
    camera.focal_point = centre


def seen_size(camera: pv.Camera, box_mm: NDArray[np.float64]) -> tuple[float, float]:
    """Width and height in millimetres of a box ``[3, 2]`` as the camera sees it."""
    forward = np.subtract(camera.focal_point, camera.position)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward / np.linalg.norm(forward))
    size = box_mm[:, 1] - box_mm[:, 0]
    return float(np.abs(right) @ size), float(np.abs(up) @ size)


def is_any_seen(camera: pv.Camera, points_mm: NDArray[np.floating], aspect: float) -> bool:
    """Whether any of ``points_mm [n, 3]`` is inside a sub-plot, without perspective.

    Args:
        camera: looks at it.
        points_mm: vertices.
        aspect: width over height of the sub-plot.
    """
    forward = np.subtract(camera.focal_point, camera.position)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward / np.linalg.norm(forward))
    places = (points_mm - np.asarray(camera.focal_point)) @ np.stack([right, up], axis=1)
    shares = places / camera.parallel_scale / (aspect, 1.0) - np.asarray(camera.GetWindowCenter())
    return bool((np.abs(shares) < 1).all(axis=1).any())
