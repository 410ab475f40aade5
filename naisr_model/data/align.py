"""Rigid alignment of scans to the atlas frame. Size is never changed.

``none`` leaves the coordinates as they are; ``landmarks`` puts one named landmark at the origin
and rotates about it; ``icp`` moves the surface onto reference points.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, get_args

import igl
import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from naisr_model.errors import InputError

Method = Literal["none", "icp", "landmarks"]
METHODS: tuple[str, ...] = get_args(Method)
Landmarks = Mapping[str, tuple[float, float, float]]

REFERENCE_POINTS = 1000
ICP_ITERATIONS = 200
ICP_TOLERANCE_MM = 2e-3
START_POINTS = 200
START_ITERATIONS = 30
START_SHIFTS = (0.0, 0.2, -0.2, 0.4, -0.4)
"""Where along the reference starts are tried, from centre on centre, as shares of its length."""

POOR_FIT = 0.01
"""From this mean distance on, as a share of the reference's longest side, turned starts are tried."""

OVERLAP_POWER = 3.0
LEAST_OVERLAP = 0.3
PROCRUSTES_ITERATIONS = 10


@dataclass(frozen=True)
class Alignment:
    """How scanner millimetres become the atlas frame.

    Attributes:
        method: ``none``, ``icp`` or ``landmarks``.
        origin: the landmark that lies at 0 in the atlas frame; empty to use the landmarks' mean.
        reference: reference positions by name in millimetres of the atlas frame; for ``icp`` the
            names are running numbers.
    """

    method: Method = "none"
    origin: str = ""
    reference: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """A plain dictionary that :meth:`from_json` reads back."""
        reference = {name: list(point) for name, point in self.reference.items()}
        return {"method": self.method, "origin": self.origin, "reference": reference}

    @classmethod
    def from_json(cls, record: Mapping[str, Any]) -> Alignment:
        """The inverse of :meth:`to_json`."""
        reference = {str(name): _point(point) for name, point in record["reference"].items()}
        return cls(record["method"], str(record["origin"]), reference)


def _point(values: Sequence[float] | NDArray[np.float64]) -> tuple[float, float, float]:
    x, y, z = map(float, values)
    return x, y, z


def read_landmarks(path: str | Path) -> dict[str, tuple[float, float, float]]:
    """Read a CSV with the columns ``name,x,y,z``, millimetres in the frame of the mesh.

    Raises:
        InputError: when the file is missing, a column is missing or a coordinate is not a number.
    """
    path = Path(path)
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"landmarks {path} cannot be read ({error}); correct the path") from error
    try:
        landmarks = {row["name"].strip(): _point([float(row[axis]) for axis in "xyz"]) for row in rows}
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"landmarks {path.name} must have the columns name,x,y,z with numbers") from error
    if not np.isfinite(list(landmarks.values())).all():
        raise InputError(f"landmarks {path.name} has a coordinate that is not a finite number")
    return landmarks


def landmark_alignment(training: Sequence[Landmarks], origin: str = "") -> Alignment:
    """Make the reference from the training subjects: rotation-only generalised Procrustes.

    Every set is centred on ``origin``; the reference is the mean of the sets after each is rotated
    onto it, started from the plain mean so that the scans' own axes survive on average.

    Args:
        training: landmarks of each training row; those that every row has are used.
        origin: name of the landmark that goes to 0; empty for their mean.

    Raises:
        InputError: when fewer than three landmarks are shared or ``origin`` is not among them.
    """
    if not training:
        raise InputError("alignment by landmarks needs a 'landmarks' column with at least one usable file")
    shared = sorted(set.intersection(*(set(landmarks) for landmarks in training)))
    if len(shared) < 3:
        raise InputError(f"alignment needs 3 landmarks that every subject has; found {shared}")
    if origin and origin not in shared:
        raise InputError(f"not every subject has the landmark '{origin}' that is to be the origin")
    sets = np.array([[landmarks[name] for name in shared] for landmarks in training])
    sets = sets - (sets[:, [shared.index(origin)]] if origin else sets.mean(axis=1, keepdims=True))
    reference = sets.mean(axis=0)
    for _ in range(PROCRUSTES_ITERATIONS):
        rotated = [Rotation.align_vectors(reference, points)[0].apply(points) for points in sets]
        reference = np.mean(rotated, axis=0)
    named = {name: _point(point) for name, point in zip(shared, reference, strict=True)}
    return Alignment("landmarks", origin, named)


def icp_alignment(mesh_mm: trimesh.Trimesh, seed: int = 0) -> Alignment:
    """Make the reference from one mesh: points on its surface, its centre of area at 0."""
    points, _ = trimesh.sample.sample_surface(mesh_mm, REFERENCE_POINTS, seed=seed)
    points = np.round(points - points.mean(axis=0), 4)
    return Alignment("icp", "", {str(i): _point(point) for i, point in enumerate(points)})


def rigid_transform(
    alignment: Alignment, mesh_mm: trimesh.Trimesh, landmarks: Landmarks | None = None
) -> NDArray[np.float64]:
    """The 4x4 matrix from scanner millimetres to the atlas frame; a rotation and a shift.

    Args:
        alignment: the population's alignment.
        mesh_mm: the scan; used by ``icp`` alone.
        landmarks: the scan's landmarks; used by ``landmarks`` alone.

    Raises:
        InputError: when the landmarks needed are missing or lie on one line.
    """
    if alignment.method == "none":
        return np.eye(4)
    if alignment.method == "icp":
        return _closest_point_transform(alignment, mesh_mm)
    return _landmark_transform(alignment, landmarks or {})


def _landmark_transform(alignment: Alignment, landmarks: Landmarks) -> NDArray[np.float64]:
    shared = [name for name in alignment.reference if name in landmarks]
    if alignment.origin and alignment.origin not in shared:
        raise InputError(f"the landmark '{alignment.origin}', the origin of the atlas, is missing")
    if len(shared) < 3:
        raise InputError(f"3 landmarks of the atlas are needed for alignment; found {shared}")
    target = np.array([alignment.reference[name] for name in shared])
    points = np.array([landmarks[name] for name in shared])
    pivot = np.asarray(landmarks[alignment.origin]) if alignment.origin else points.mean(axis=0)
    goal = np.zeros(3) if alignment.origin else target.mean(axis=0)
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if spread[1] < 1e-6 * max(spread[0], 1e-12):
        raise InputError("the landmarks lie on one line, so the rotation is not determined")
    rotation = Rotation.align_vectors(target - goal, points - pivot)[0].as_matrix()
    return _matrix(rotation, goal - rotation @ pivot)


@dataclass(frozen=True, eq=False)
class Proposal:
    """A rigid motion to be looked at before it is accepted.

    Attributes:
        transform: 4x4, scanner millimetres to the atlas frame.
        before_mm: mean distance of the scan's surface to the reference shape as the scan lies.
        after_mm: the same after the motion.
        landmarks_mm: root mean square distance of the landmarks after the motion; None without them.
    """

    transform: NDArray[np.float64]
    before_mm: float
    after_mm: float
    landmarks_mm: float | None = None


def propose(
    method: Method,
    mesh_mm: trimesh.Trimesh,
    reference_mm: trimesh.Trimesh,
    alignment: Alignment | None = None,
    landmarks: Landmarks | None = None,
) -> Proposal:
    """Find the motion of one scan to the atlas frame without making it.

    Args:
        method: ``none``, ``icp`` onto the reference shape, or ``landmarks`` onto the atlas's.
        mesh_mm: the scan; a surface, whole or in part, or points without faces.
        reference_mm: the atlas's own shape, best at what is known of the patient, since size is kept.
        alignment: that of the atlas; for ``landmarks``.
        landmarks: those of the scan, in its coordinates; for ``landmarks``.

    Raises:
        InputError: when landmarks are asked for and the atlas or the scan has none or too few.
    """
    transform, landmarks_mm = np.eye(4), None
    scan = _surface_side(mesh_mm, REFERENCE_POINTS)
    reference = _surface_side(reference_mm, REFERENCE_POINTS)
    if method == "landmarks":
        if alignment is None or alignment.method != "landmarks":
            raise InputError("this atlas was not aligned by landmarks; choose icp or none")
        transform = _landmark_transform(alignment, landmarks or {})
        landmarks_mm = _landmark_residual_mm(alignment, landmarks or {}, transform)
    elif method == "icp":
        transform = _register(scan, reference, bool(mesh_mm.is_watertight))
    before_mm, after_mm = (_mean_distance_mm(scan, reference, matrix) for matrix in (np.eye(4), transform))
    return Proposal(transform, before_mm, after_mm, landmarks_mm)


def _landmark_residual_mm(
    alignment: Alignment, landmarks: Landmarks, transform: NDArray[np.float64]
) -> float:
    shared = [name for name in alignment.reference if name in landmarks]
    found = _applied(transform, np.array([landmarks[name] for name in shared]))
    away = found - np.array([alignment.reference[name] for name in shared])
    return float(np.sqrt((away**2).sum(axis=1).mean()))


def _mean_distance_mm(scan: _Side, reference: _Side, transform: NDArray[np.float64]) -> float:
    points = _applied(transform, scan.samples)
    return float(np.linalg.norm(reference.nearest(points) - points, axis=1).mean())


def _applied(transform: NDArray[Any], points: NDArray[Any]) -> NDArray[np.float64]:
    return points @ transform[:3, :3].T + transform[:3, 3]


def _register(scan: _Side, reference: _Side, whole: bool) -> NDArray[np.float64]:
    """Trimmed closest points from several starts; turned ones only where the scan's own axes fail.

    Of a part, the reference's pairs are left out: they would draw it to the middle of the whole.
    """
    kept = (_overlapping, _overlapping if whole else _nothing)
    few = _thinned(scan), _thinned(reference)
    best = _best(few, [np.eye(4), *_shifted(few, np.eye(3))], kept)
    if _misfit_mm(*few, best, kept) > POOR_FIT * np.ptp(reference.samples, axis=0).max():
        turned = [start for rotation in _turns(few) for start in _shifted(few, rotation)]
        best = _best(few, [best, *turned], kept)
    return _closest_points(scan, reference, best, kept, ICP_ITERATIONS)


def _thinned(side: _Side) -> _Side:
    """Samples come in random order, so the first ones cover the shape as well."""
    return replace(side, samples=side.samples[:START_POINTS])


def _best(
    sides: tuple[_Side, _Side], starts: Sequence[NDArray[np.float64]], kept: tuple[Kept, Kept]
) -> NDArray[np.float64]:
    found = [_closest_points(*sides, start, kept, START_ITERATIONS) for start in starts]
    return min(found, key=lambda transform: _misfit_mm(*sides, transform, kept))


def _misfit_mm(
    scan: _Side, reference: _Side, transform: NDArray[np.float64], kept: tuple[Kept, Kept]
) -> float:
    """Mean of the smallest costs of :func:`_overlap_costs` over the directions in use."""
    points = _applied(transform, scan.samples)
    back = _applied(np.linalg.inv(transform), reference.samples)
    here = np.linalg.norm(reference.nearest(points) - points, axis=1)
    there = np.linalg.norm(scan.nearest(back) - back, axis=1)
    used = [distances for distances, keep in zip((here, there), kept, strict=True) if keep(distances).any()]
    return float(np.mean([_overlap_costs(distances).min() for distances in used]))


def _shifted(sides: tuple[_Side, _Side], rotation: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Starts with centre on centre and moved along the reference's longest axis, where a part may lie."""
    points, target = (side.samples for side in sides)
    middle = target.mean(axis=0) - rotation @ points.mean(axis=0)
    axis = _axes(target)[:, 0]
    length = float(np.ptp(target @ axis))
    return [_matrix(rotation, middle + share * length * axis) for share in START_SHIFTS]


def _turns(sides: tuple[_Side, _Side]) -> list[NDArray[np.float64]]:
    """The four rotations that lay principal axes on principal axes."""
    axes, goal = (_axes(side.samples) for side in sides)
    signs = [(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)]
    return [goal @ np.diag(np.array(sign, float)) @ axes.T for sign in signs]


def _axes(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Principal axes as the columns of a rotation, the longest first."""
    axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2].T
    return axes * np.array([1.0, 1.0, np.linalg.det(axes)])


def _overlapping(distances_mm: NDArray[np.float64]) -> NDArray[np.bool_]:
    """The share of nearest pairs at which the fractional distance is least, so that a missing part drops out.

    Phillips, Liu and Tomasi, "Outlier robust ICP for minimizing fractional RMSD", 2007: root mean square
    of the share f, divided by f to a power; no share has to be given.
    """
    order = np.argsort(distances_mm, kind="stable")
    costs = _overlap_costs(distances_mm)
    kept = np.zeros(len(order), dtype=bool)
    kept[order[: len(order) - len(costs) + int(costs.argmin()) + 1]] = True
    return kept


def _overlap_costs(distances_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cost of keeping the nearest pairs, for each share from :data:`LEAST_OVERLAP` to 1."""
    count = np.arange(1, len(distances_mm) + 1)
    rms_mm = np.sqrt(np.cumsum(np.sort(distances_mm) ** 2) / count)
    costs = rms_mm / (count / len(count)) ** OVERLAP_POWER
    return costs[int(LEAST_OVERLAP * len(count)) :]


def _closest_point_transform(alignment: Alignment, mesh_mm: trimesh.Trimesh) -> NDArray[np.float64]:
    """Move a whole scan onto the reference points, started with the centres matched."""
    points = np.array(list(alignment.reference.values()))
    tree = cKDTree(points)
    reference = _Side(points, lambda query: points[tree.query(query)[1]])
    scan = _surface_side(mesh_mm, len(points))
    start = _matrix(np.eye(3), points.mean(axis=0) - scan.samples.mean(axis=0))
    return _closest_points(scan, reference, start, (_everything, _everything), ICP_ITERATIONS)


@dataclass(frozen=True, eq=False)
class _Side:
    """One of the two shapes: points on it, ``[n, 3]``, and the nearest points of it to others."""

    samples: NDArray[np.float64]
    nearest: Callable[[NDArray[np.float64]], NDArray[np.float64]]


def _surface_side(mesh_mm: trimesh.Trimesh, count: int) -> _Side:
    """Of a mesh its surface, of a cloud its points."""
    vertices = np.ascontiguousarray(mesh_mm.vertices, dtype=np.float64)
    if not len(mesh_mm.faces):
        tree = cKDTree(vertices)
        chosen = np.random.default_rng(0).permutation(len(vertices))[:count]
        return _Side(vertices[chosen], lambda query: vertices[tree.query(query)[1]])
    faces = np.ascontiguousarray(mesh_mm.faces, dtype=np.int64)
    surface = igl.AABB()
    surface.init(vertices, faces)
    samples = np.asarray(trimesh.sample.sample_surface(mesh_mm, count, seed=0)[0])
    return _Side(samples, lambda query: surface.squared_distance(vertices, faces, query)[2])


Kept = Callable[[NDArray[np.float64]], NDArray[np.bool_]]
"""Which pairs of nearest points count, by their distances."""


def _nothing(distances_mm: NDArray[np.float64]) -> NDArray[np.bool_]:
    return np.zeros(len(distances_mm), dtype=bool)


def _everything(distances_mm: NDArray[np.float64]) -> NDArray[np.bool_]:
    return np.ones(len(distances_mm), dtype=bool)


def _closest_points(
    scan: _Side,
    reference: _Side,
    start: NDArray[np.float64],
    kept: tuple[Kept, Kept],
    iterations: int,
) -> NDArray[np.float64]:
    """Iterative closest points in both directions at once (Besl and McKay, 1992).

    One direction alone drifts when the shapes differ in size: a small shape inside a large one is
    drawn to whichever wall is near.

    Args:
        scan: the shape to be moved.
        reference: the shape that it is moved onto.
        start: 4x4, scan to reference.
        kept: which pairs count, of those from the scan and of those from the reference.
        iterations: at most so many.
    """
    rotation, shift_mm = start[:3, :3], start[:3, 3]
    for _ in range(iterations):
        last = scan.samples @ rotation.T + shift_mm
        to_reference = reference.nearest(last)
        to_scan = scan.nearest((reference.samples - shift_mm) @ rotation)
        back = to_scan @ rotation.T + shift_mm
        here = kept[0](np.linalg.norm(to_reference - last, axis=1))
        there = kept[1](np.linalg.norm(reference.samples - back, axis=1))
        points = np.concatenate([to_scan[there], scan.samples[here]])
        goals = np.concatenate([reference.samples[there], to_reference[here]])
        centre, goal = points.mean(axis=0), goals.mean(axis=0)
        rotation = Rotation.align_vectors(goals - goal, points - centre)[0].as_matrix()
        shift_mm = goal - rotation @ centre
        if np.abs(scan.samples @ rotation.T + shift_mm - last).max() < ICP_TOLERANCE_MM:
            break
    return _matrix(rotation, shift_mm)


def _matrix(rotation: NDArray[np.float64], shift_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, shift_mm
    return matrix
