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


FLAT = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0))
"""The one view of curves in the plane: x to the right, y upwards."""


def aim(camera: pv.Camera, box_mm: NDArray[np.float64]) -> None:
    """Look at the middle of a box ``[3, 2]`` from well outside, keeping the direction."""
    direction = np.subtract(camera.position, camera.focal_point)
    distance = 3 * np.linalg.norm(box_mm[:, 1] - box_mm[:, 0])
    centre = box_mm.mean(axis=1)
    camera.position = centre + direction / np.linalg.norm(direction) * distance
    camera.focal_point = centre


def axes_of(camera: pv.Camera) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The directions to the right and up of the picture, of length 1."""
    forward = np.subtract(camera.focal_point, camera.position)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    return right, np.cross(right, forward / np.linalg.norm(forward))


def shift(camera: pv.Camera, by_mm: NDArray[np.float64]) -> None:
    """Move the camera and what it looks at, ``[3]``, keeping direction and zoom."""
    camera.position, camera.focal_point = camera.position + by_mm, camera.focal_point + by_mm


def centre_on(camera: pv.Camera, point_mm: Direction) -> None:
    """Have a point in the middle, keeping direction and zoom."""
    shift(camera, np.subtract(point_mm, camera.focal_point))


def pan(camera: pv.Camera, across: float, along: float) -> None:
    """Have the shapes go to the right and up by shares of half the height of a sub-plot."""
    right, up = axes_of(camera)
    shift(camera, -camera.parallel_scale * (across * right + along * up))


def turn(camera: pv.Camera, azimuth_deg: float, elevation_deg: float) -> None:
    """Go around what is looked at, to the right and up; what is up in the picture stays so."""
    camera.Azimuth(azimuth_deg)
    camera.Elevation(elevation_deg)
    camera.OrthogonalizeViewUp()


def zoom_at(camera: pv.Camera, factor: float, place: tuple[float, float], aspect: float) -> None:
    """Come nearer by a factor, keeping what is at a place of a sub-plot where it is.

    Args:
        camera: without perspective.
        factor: 2 shows everything twice as large.
        place: to the right and up of the middle of the sub-plot, 1 at its edges.
        aspect: width over height of the sub-plot.
    """
    right, up = axes_of(camera)
    across, along = (np.asarray(place) + camera.GetWindowCenter()) * (aspect, 1.0)
    before = camera.parallel_scale
    camera.parallel_scale = before / factor
    shift(camera, (before - camera.parallel_scale) * (across * right + along * up))


def seen_size(camera: pv.Camera, box_mm: NDArray[np.float64]) -> tuple[float, float]:
    """Width and height in millimetres of a box ``[3, 2]`` as the camera sees it."""
    right, up = axes_of(camera)
    size = box_mm[:, 1] - box_mm[:, 0]
    return float(np.abs(right) @ size), float(np.abs(up) @ size)


def is_any_seen(camera: pv.Camera, points_mm: NDArray[np.floating], aspect: float) -> bool:
    """Whether any of ``points_mm [n, 3]`` is inside a sub-plot, without perspective.

    Args:
        camera: looks at it.
        points_mm: vertices.
        aspect: width over height of the sub-plot.
    """
    right, up = axes_of(camera)
    places = (points_mm - np.asarray(camera.focal_point)) @ np.stack([right, up], axis=1)
    shares = places / camera.parallel_scale / (aspect, 1.0) - np.asarray(camera.GetWindowCenter())
    return bool((np.abs(shares) < 1).all(axis=1).any())
