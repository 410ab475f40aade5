"""Closed curves in the plane, the 2D sisters of ``trimesh.Trimesh``.

What both have is named alike, one dimension lower: ``faces`` are the segments of the curve, ``area`` is their
length and ``volume`` what the curve encloses, so that whoever asks for one of these need not know which of
the two it is. What differs is found in :mod:`naisr_model.shapes.kinds`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import igl
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

Points = NDArray[np.float64]

FEWEST_LEFT = 8
"""Vertices of a polygon that are left when a curve is thinned."""

CORNER = 1e-9
"""Share of a segment within which its end is meant."""


@dataclass(eq=False)
class Curve:
    """Closed polygons that bound a part of the plane; each segment has the inside on its left.

    Attributes:
        vertices: ``[n, 2]``, in any one unit of length.
        faces: the segments, as numbers of the vertices where they begin and end, ``[m, 2]``.
    """

    vertices: Points
    faces: NDArray[np.int64]

    @property
    def bounds(self) -> Points:
        """The smallest and the largest coordinates, ``[2, 2]``."""
        used = self.vertices[np.unique(self.faces)]
        return np.stack([used.min(axis=0), used.max(axis=0)])

    @property
    def lengths(self) -> Points:
        """Of each segment, ``[m]``."""
        return np.asarray(np.linalg.norm(self._steps, axis=1))

    @property
    def area(self) -> float:
        """How long the curve is: what ``Trimesh.area`` is one dimension higher."""
        return float(self.lengths.sum())

    @property
    def volume(self) -> float:
        """What the polygons enclose, in the unit squared: ``Trimesh.volume`` one dimension higher."""
        (begin_x, begin_y), (end_x, end_y) = (self.vertices[self.faces[:, side]].T for side in (0, 1))
        return float((begin_x * end_y - end_x * begin_y).sum() / 2)

    @property
    def face_normals(self) -> Points:
        """Outward unit normals of the segments, ``[m, 2]``."""
        return outward(self._steps)

    @property
    def vertex_normals(self) -> Points:
        """Outward unit normals at the vertices, the mean of both segments', ``[n, 2]``."""
        sums = np.zeros_like(self.vertices)
        normals = self.face_normals
        for side in (0, 1):
            np.add.at(sums, self.faces[:, side], normals)
        return sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-12)

    @property
    def loops(self) -> list[NDArray[np.int64]]:
        """The vertices of each closed polygon in their order, a list of numbers each."""
        following = dict(self.faces.tolist())
        found = []
        while following:
            start, _ = next(iter(following.items()))
            loop, at = [], start
            while at in following:
                loop.append(at)
                at = following.pop(at)
            found.append(np.array(loop))
        return found

    @cached_property
    def pieces(self) -> int:
        """Polygons that share no vertex; 0 where there is no curve."""
        if not len(self.faces):
            return 0
        begin, end = np.unique(self.faces, return_inverse=True)[1].reshape(-1, 2).T
        joined = coo_array((np.ones(len(begin)), (begin, end)), shape=(begin.max() + 1,) * 2)
        return int(connected_components(joined, directed=False)[0])

    def sampled(self, count: int, rng: np.random.Generator) -> tuple[Points, Points]:
        """Points spread evenly by length, and the outward normals of their segments, ``[count, 2]`` each."""
        chosen = rng.choice(len(self.faces), size=count, p=self.lengths / self.area)
        begin, share = self.vertices[self.faces[chosen, 0]], rng.random((count, 1))
        return begin + share * self._steps[chosen], self.face_normals[chosen]

    def sample(self, count: int, *, seed: int | np.random.SeedSequence) -> Points:
        """Points spread evenly by length, ``[count, 2]``; the same seed gives the same points."""
        return self.sampled(count, np.random.default_rng(seed))[0]

    def signed_distance(self, points: Points) -> Points:
        """Exact distance of ``points [n, 2]`` to the polygons, negative inside, ``[n]``.

        The sign is that of the normal at the nearest point, where two segments meet that of both together,
        which is right for curves that do not cross themselves.
        """
        points = np.ascontiguousarray(points, dtype=np.float64)
        vertices, faces = np.ascontiguousarray(self.vertices), np.ascontiguousarray(self.faces)
        squared, nearest, places = igl.point_mesh_squared_distance(points, vertices, faces)
        begin, step = vertices[faces[nearest, 0]], self._steps[nearest]
        along = ((places - begin) * step).sum(axis=1) / np.maximum((step**2).sum(axis=1), 1e-300)
        normals, at_corners = self.face_normals[nearest], self.vertex_normals
        for side, is_there in ((0, along <= CORNER), (1, along >= 1 - CORNER)):
            normals[is_there] = at_corners[faces[nearest[is_there], side]]
        outside = ((points - places) * normals).sum(axis=1) >= 0
        return np.where(outside, 1.0, -1.0) * np.sqrt(np.maximum(squared, 0.0))

    def copy(self) -> Curve:
        """The same curve, to be changed."""
        return Curve(self.vertices.copy(), self.faces.copy())

    def apply_transform(self, transform: Points) -> Curve:
        """Move the vertices by a matrix ``[3, 3]`` and return the curve."""
        self.vertices = self.vertices @ transform[:2, :2].T + transform[:2, 2]
        return self

    @property
    def _steps(self) -> Points:
        return np.asarray(self.vertices[self.faces[:, 1]] - self.vertices[self.faces[:, 0]])


def outward(steps: Points) -> Points:
    """Unit normals to the right of steps ``[m, 2]``, where the outside is."""
    lengths = np.linalg.norm(steps, axis=1, keepdims=True)
    return np.stack([steps[:, 1], -steps[:, 0]], axis=1) / np.maximum(lengths, 1e-300)


def closed(loops: Sequence[Points]) -> Curve:
    """The curve of closed polygons ``[n, 2]``, whichever way round they go.

    What lies inside of an odd number of others is a hole.
    """
    sizes = [len(loop) for loop in loops]
    first = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64) if sizes else np.zeros(0, np.int64)
    faces = [start + _ring(size) for start, size in zip(first, sizes, strict=True)]
    turned = [
        ring if _is_left_round(loop) != bool(_depth(i, loops) % 2) else ring[:, ::-1]
        for i, (ring, loop) in enumerate(zip(faces, loops, strict=True))
    ]
    vertices = np.concatenate([np.zeros((0, 2)), *loops])
    return Curve(vertices, np.concatenate([np.zeros((0, 2), np.int64), *turned]))


def thinned(curve: Curve, most: int) -> Curve:
    """A curve with about as many vertices as are wanted at most; itself where it has no more."""
    step = -(-len(curve.vertices) // most)
    if step == 1:
        return curve
    loops = [loop[:: min(step, max(1, len(loop) // FEWEST_LEFT))] for loop in curve.loops]
    return closed([curve.vertices[loop] for loop in loops])


def _ring(size: int) -> NDArray[np.int64]:
    numbers = np.arange(size)
    return np.stack([numbers, np.roll(numbers, -1)], axis=1)


def _is_left_round(loop: Points) -> bool:
    return Curve(loop, _ring(len(loop))).volume > 0


def _depth(index: int, loops: Sequence[Points]) -> int:
    """In how many of the other polygons one lies."""
    return sum(contains(other, loops[index][0]) for i, other in enumerate(loops) if i != index)


def contains(loop: Points, point: Points) -> bool:
    """Whether a point ``[2]`` lies in a polygon ``[n, 2]``: a ray from it crosses an odd number of sides."""
    begin, end = loop - point, np.roll(loop, -1, axis=0) - point
    crosses = (begin[:, 1] > 0) != (end[:, 1] > 0)
    rise = np.where(crosses, end[:, 1] - begin[:, 1], 1.0)
    return bool((crosses & (begin[:, 0] - begin[:, 1] * (end[:, 0] - begin[:, 0]) / rise > 0)).sum() % 2)


def enclosed_area(curve: Curve) -> float:
    """Area inside the smooth curve through the vertices, in their unit squared.

    The polygon alone lies inside a convex curve. A side from a to b with normals n_a and n_b is an arc whose
    middle stands (n_b - n_a) . (b - a) / 8 above the chord, and holds two thirds of that times its length.
    """
    normals, steps = curve.vertex_normals[curve.faces], curve.vertices[curve.faces]
    turns, chords = normals[:, 1] - normals[:, 0], steps[:, 1] - steps[:, 0]
    sags = (turns * chords).sum(axis=1) / 8
    return float(curve.volume + 2 / 3 * (sags * curve.lengths).sum())
