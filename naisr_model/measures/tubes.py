"""Tubes: stations along a tube-like surface, which move with it, and what its cross-sections are there.

A coordinate along a tube comes from the surface itself: the first eigenfunction of its Laplacian that is not
constant runs from one end to the other, as cos(pi s / L) does along a rod of length L, and its level sets are
rings around the tube (Shi et al., *Anisotropic Laplace-Beltrami eigenmaps*, 2008). No end has to be chosen,
and where a tube divides, as the nose does, the rings of the branches belong together.

Rings are found once. They cross the same edges at the same shares in every shape with the same vertices, so
that a station is the same material place in all of them, and their centres are the centreline.

The area of a cross-section is the vector area of its rings, half of the sum of a x b over their segments,
along the centreline. In a straight part of a tube it does not depend on how a ring lies.
"""

from __future__ import annotations

from dataclasses import dataclass

import igl
import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.sparse.linalg import eigsh

STATIONS = 200
"""From one end to the other."""

CAP = 1.5
"""Mean radii at either end, along the surface, that have no stations: a ring there lies on the cap."""

REACH = 3
"""Stations on either side from which the direction of the centreline is taken."""

LEAST_RATIO = 2.0
"""Of the second eigenvalue to the first: a rod has 4, a ball 1, a body with limbs 1.2, an airway with its two
nasal passages 3."""

LEAST_SLENDERNESS = 3.0
"""Of the length to the mean diameter."""

LEAST_FACES = 50
"""Of what may be a tube."""

LEAST_AREA = 1e-9
"""Of the mean triangle's; a smaller one has no angles."""

Points = NDArray[np.floating]


@dataclass(frozen=True, eq=False)
class Sections:
    """The cross-sections of a tube at its stations, N of them.

    Attributes:
        centres_mm: the centreline, from the upper end of the template to the lower one, ``[N, 3]``.
        areas_mm2: of the cross-sections, branches together, ``[N]``.
        places_mm: way along the centreline from the first end, ``[N]``.
        length_mm: from end to end.
    """

    centres_mm: NDArray[np.float64]
    areas_mm2: NDArray[np.float64]
    places_mm: NDArray[np.float64]
    length_mm: float

    @property
    def narrowest(self) -> int:
        """The station with the smallest cross-section; the ends of the tube have none."""
        return int(self.areas_mm2.argmin())


@dataclass(frozen=True, eq=False)
class Tube:
    """Stations of a surface, for all shapes with its vertices.

    Attributes:
        corners: vertex numbers of the edges that rings cross, both ends of each segment, ``[m, 2, 2]``.
        shares: how far along these edges, ``[m, 2]``.
        stations: to whose ring each segment belongs, ``[m]``.
        poles: the vertices at the two ends.
    """

    corners: NDArray[np.intp]
    shares: NDArray[np.float64]
    stations: NDArray[np.intp]
    poles: tuple[int, int]

    def sections(self, points_mm: Points) -> Sections:
        """Of the shape whose vertices are at ``points_mm [n, 3]``."""
        points = np.asarray(points_mm, dtype=np.float64)
        centres, vectors = self._rings(points)
        directions = _directions(centres)
        steps = np.linalg.norm(np.diff(centres, axis=0), axis=1)
        first, last = points[list(self.poles)]
        before, after = (centres[0] - first) @ directions[0], (last - centres[-1]) @ directions[-1]
        places = float(before) + np.concatenate([[0.0], np.cumsum(steps)])
        areas = np.abs(np.einsum("ni,ni->n", vectors, directions))
        return Sections(centres, areas, places, float(places[-1] + after))

    def _rings(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Centre and vector area of each station's rings, ``[N, 3]`` each."""
        from_, to = points[self.corners[..., 0]], points[self.corners[..., 1]]
        ends = from_ + self.shares[..., None] * (to - from_)
        weights = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        centres = self._summed(weights[:, None] * ends.mean(axis=1)) / self._summed(weights[:, None])
        # About the centre, or rounding far from the origin would count.
        ends = ends - centres[self.stations, None]
        return centres, self._summed(np.cross(ends[:, 0], ends[:, 1])) / 2

    def _summed(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Sums of each station's rows, ``[N, k]``."""
        return np.stack([np.bincount(self.stations, column) for column in rows.T], axis=1)


def tube_of(mesh: trimesh.Trimesh) -> Tube | None:
    """The stations of a surface, or None where it is not tube-like.

    Tube-like is what is slender, its centreline :data:`LEAST_SLENDERNESS` times as long as its mean diameter,
    and runs in one direction: the second eigenvalue of its Laplacian is :data:`LEAST_RATIO` times the first.
    Of several pieces the largest counts. It may be open at its ends.

    Args:
        mesh: any unit.
    """
    points = np.asarray(mesh.vertices, dtype=np.float64)
    faces = _largest_piece(_sound(points, np.asarray(mesh.faces, dtype=np.int64)))
    coordinate = _coordinate(points, faces) if len(faces) >= LEAST_FACES else None
    if coordinate is None:
        return None
    tube = _even(points, faces, coordinate)
    return tube if _is_slender(tube.sections(points)) else None


def _sound(points: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Those that have an area."""
    a, b, c = (points[faces[:, corner]] for corner in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return faces[areas > LEAST_AREA * areas[np.isfinite(areas)].mean()] if len(faces) else faces


def _is_slender(sections: Sections) -> bool:
    diameter = 2 * np.sqrt(sections.areas_mm2.mean() / np.pi)
    return bool(sections.length_mm >= LEAST_SLENDERNESS * diameter)


def _largest_piece(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    if not len(faces):
        return faces
    pieces = igl.facet_components(faces)[1]
    return np.ascontiguousarray(faces[pieces == np.bincount(pieces).argmax()])


def _coordinate(points: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64] | None:
    """From 0 at the upper end to 1, about even along the way, NaN off the piece; None for what is no tube."""
    used, numbers = np.unique(faces, return_inverse=True)
    faces = np.ascontiguousarray(numbers.reshape(-1, 3))
    own = np.ascontiguousarray(points[used])
    stiffness = -igl.cotmatrix(own, faces)
    mass = igl.massmatrix(own, faces, igl.MASSMATRIX_TYPE_VORONOI)
    scale = stiffness.diagonal().mean() / mass.diagonal().mean()
    start = np.ones(len(own)) + own[:, 0] / max(float(np.ptp(own[:, 0])), 1e-12)
    try:
        values, waves = eigsh(stiffness, k=3, M=mass, sigma=-1e-6 * scale, v0=start)
    except RuntimeError:  # a crumpled surface has no Laplacian to speak of
        return None
    if not values[2] >= LEAST_RATIO * values[1] > 0:
        return None
    wave = waves[:, 1] * np.sign(own[waves[:, 1].argmin(), 2] - own[waves[:, 1].argmax(), 2] or 1.0)
    share = (wave - wave.min()) / np.ptp(wave)
    result = np.full(len(points), np.nan)
    result[used] = np.arcsin(2 * share - 1) / np.pi + 0.5
    return result


def _even(points: Points, faces: NDArray[np.int64], coordinate: NDArray[np.float64]) -> Tube:
    """Stations at even distances along the centreline."""
    rough = _cut(faces, coordinate, np.linspace(0, 1, STATIONS + 2)[1:-1]).sections(points)
    radius = np.sqrt(np.median(rough.areas_mm2) / np.pi)
    margin = CAP * radius / (rough.length_mm + 2 * radius)
    levels = np.linspace(margin, 1 - margin, STATIONS)
    places = _cut(faces, coordinate, levels).sections(points).places_mm
    return _cut(faces, coordinate, np.interp(np.linspace(places[0], places[-1], STATIONS), places, levels))


def _cut(faces: NDArray[np.int64], coordinate: NDArray[np.float64], levels: NDArray[np.float64]) -> Tube:
    """The rings where the coordinate has the given levels."""
    parts = [_crossings(faces, coordinate, level) for level in levels]
    numbers = np.repeat(np.arange(len(levels)), [len(corners) for corners, _ in parts])
    poles = int(np.nanargmin(coordinate)), int(np.nanargmax(coordinate))
    corners, shares = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Tube(corners, shares, numbers, poles)


def _crossings(
    faces: NDArray[np.int64], coordinate: NDArray[np.float64], level: float
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Segments of one level's rings: edges ``[m, 2, 2]`` and shares ``[m, 2]``, all turning the same way."""
    above = coordinate[faces] >= level
    count = above.sum(axis=1)
    crossed = (count == 1) | (count == 2)
    above, faces = above[crossed], faces[crossed]
    # The corner that is alone on its side, and the next two by the right hand.
    lone = np.where(count[crossed] == 1, above.argmax(axis=1), above.argmin(axis=1))
    rows = np.arange(len(faces))
    tip, left, right = (faces[rows, (lone + turn) % 3] for turn in range(3))
    corners = np.stack([np.stack([tip, left], axis=1), np.stack([tip, right], axis=1)], axis=1)
    falls = count[crossed] == 2
    corners[falls] = corners[falls][:, ::-1]
    heights = coordinate[corners]
    return corners, (level - heights[..., 0]) / (heights[..., 1] - heights[..., 0])


def _directions(centres: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vectors along the centreline, ``[N, 3]``."""
    numbers = np.arange(len(centres))
    ahead = centres[(numbers + REACH).clip(max=len(centres) - 1)] - centres[(numbers - REACH).clip(min=0)]
    return np.asarray(ahead / np.linalg.norm(ahead, axis=1, keepdims=True).clip(min=1e-12))
