"""Rigid alignment of scans to the atlas frame. Size is never changed.

``none`` leaves the coordinates as they are; ``landmarks`` puts one named landmark at the origin
and rotates about it; ``icp`` moves the surface onto reference points.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, cast, get_args

import igl
import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from naisr_model import records
from naisr_model.data.markups import Space, read_markups
from naisr_model.data.meshes import rim
from naisr_model.errors import InputError
from naisr_model.progress import SILENT, Progress
from naisr_model.shapes.kinds import Shape

Method = Literal["none", "icp", "landmarks"]
METHODS: tuple[str, ...] = get_args(Method)
Landmarks = Mapping[str, tuple[float, float, float]]

REFERENCE_POINTS = 1000
ICP_ITERATIONS = 200
ICP_TOLERANCE_MM = 2e-3
SCOUT_POINTS, SCOUT_ITERATIONS, SCOUT_CLOUD = 100, 6, 4000
"""What every start gets; so many points stand for the surface then."""

PROMISING, START_POINTS, START_ITERATIONS = 10, 200, 30
"""How many of the starts go on, no two alike, and with what."""

ALIKE_DEG, ALIKE_SHARE = 10.0, 0.05
"""Up to which two starts are alike: by turn, and by shift as a share of the reference's length."""

START_SHIFTS = (0.0, 0.2, -0.2, 0.4, -0.4)
"""Where along the reference starts are tried, from centre on centre, as shares of its length."""

ALIKE, DOUBTFUL = 1.25, 1.6
"""Costs of two orientations, as a ratio, up to which they explain a scan equally well and nearly as well.
Of airways and bodies, whole and cut, other orientations cost from 1.7 times as much on."""

UPRIGHT_DEG, RIVAL_DEG = 15.0, 45.0
"""Up to the first, two orientations count as one; from the second on, as different."""

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
    def from_json(cls, record: dict[str, Any]) -> Alignment:
        """The inverse of :meth:`to_json`.

        Raises:
            ValueError: for what that never gives.
        """
        places = records.entry(record, "reference", dict)
        reference = {name: _point(records.numbers(places, name, 3)) for name in places}
        method, origin = records.entry(record, "method", str), records.entry(record, "origin", str)
        if method not in METHODS:
            raise ValueError(f"the alignment is by '{method}'")
        if len(reference) < {"none": 0, "landmarks": 1, "icp": 3}[method]:
            raise ValueError(f"the alignment by {method} has {len(reference)} points of reference")
        if method == "landmarks" and origin and origin not in reference:
            raise ValueError(f"the alignment has no landmark '{origin}', its origin")
        return cls(cast(Method, method), origin, reference)


def _point(values: Sequence[float] | NDArray[np.float64]) -> tuple[float, float, float]:
    x, y, z = map(float, values)
    return x, y, z


def read_landmarks(path: str | Path, space: Space = "LPS") -> dict[str, tuple[float, float, float]]:
    """Read landmarks in millimetres in the frame of a mesh.

    Args:
        path: a CSV with the columns ``name,x,y,z`` in the frame of the mesh, or a ``.fcsv`` or ``.mrk.json``
            of 3D Slicer, which states whether it is in LPS or RAS.
        space: that of the mesh, into which the latter are turned.

    Raises:
        InputError: when the file or a column is missing, a name or a place is there twice, or a coordinate is
            no number or beyond any scanner.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"landmarks {path} cannot be read (there is no such file); correct the path")
    return read_markups(path, space)


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
    alignment: Alignment, mesh_mm: Shape, landmarks: Landmarks | None = None
) -> NDArray[np.float64]:
    """The matrix ``[dim + 1, dim + 1]`` from scanner millimetres to the atlas frame; a rotation and a shift.

    Args:
        alignment: the population's alignment.
        mesh_mm: the scan; used by ``icp`` alone.
        landmarks: the scan's landmarks; used by ``landmarks`` alone.

    Raises:
        InputError: when the landmarks needed are missing or lie on one line.
    """
    if alignment.method == "none":
        return np.eye(np.shape(mesh_mm.vertices)[1] + 1)
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
        turned_deg: by how much the motion turns the scan about some axis.
        rival_deg: how far from the proposed orientation another one lies that explains the shape nearly
            as well; None where there is no such doubt, or where it was not asked.
        landmarks_mm: root mean square distance of the landmarks after the motion; None without them.
    """

    transform: NDArray[np.float64]
    before_mm: float
    after_mm: float
    turned_deg: float
    rival_deg: float | None = None
    landmarks_mm: float | None = None


def propose(
    method: Method,
    mesh_mm: trimesh.Trimesh,
    reference_mm: trimesh.Trimesh,
    alignment: Alignment | None = None,
    landmarks: Landmarks | None = None,
    progress: Progress = SILENT,
) -> Proposal:
    """Find the motion of one scan to the atlas frame without making it.

    Args:
        method: ``none``, ``icp`` onto the reference shape, or ``landmarks`` onto the atlas's.
        mesh_mm: the scan; a surface, whole or in part, or points without faces.
        reference_mm: the atlas's own shape, best at what is known of the patient, since size is kept.
        alignment: that of the atlas; for ``landmarks``.
        landmarks: those of the scan, in its coordinates; for ``landmarks``.
        progress: told the share of what ``icp`` seeks.

    Raises:
        InputError: when landmarks are asked for and the atlas or the scan has none or too few.
        Cancelled: when nobody waits any more.
    """
    transform, rival_deg, landmarks_mm = np.eye(4), None, None
    scan = _scan_side(mesh_mm, REFERENCE_POINTS)
    reference = _surface_side(reference_mm, REFERENCE_POINTS)
    if method == "landmarks":
        if alignment is None or alignment.method != "landmarks":
            raise InputError("this atlas was not aligned by landmarks; choose icp or none")
        transform = _landmark_transform(alignment, landmarks or {})
        landmarks_mm = _landmark_residual_mm(alignment, landmarks or {}, transform)
    elif method == "icp":
        transform, rival_deg = _register(scan, reference, progress)
    before_mm, after_mm = (_mean_distance_mm(scan, reference, matrix) for matrix in (np.eye(4), transform))
    return Proposal(transform, before_mm, after_mm, _angle_deg(transform), rival_deg, landmarks_mm)


def _landmark_residual_mm(
    alignment: Alignment, landmarks: Landmarks, transform: NDArray[np.float64]
) -> float:
    shared = [name for name in alignment.reference if name in landmarks]
    found = _applied(transform, np.array([landmarks[name] for name in shared]))
    away = found - np.array([alignment.reference[name] for name in shared])
    return float(np.sqrt((away**2).sum(axis=1).mean()))


def _mean_distance_mm(scan: _Side, reference: _Side, transform: NDArray[np.float64]) -> float:
    points = _applied(transform, scan.samples)
    return float(np.linalg.norm(reference.nearest(points)[0] - points, axis=1).mean())


def _applied(transform: NDArray[Any], points: NDArray[Any]) -> NDArray[np.float64]:
    return points @ transform[:3, :3].T + transform[:3, 3]


def _angle_deg(transform: NDArray[np.float64]) -> float:
    return float(np.degrees(Rotation.from_matrix(transform[:3, :3]).magnitude()))


def _register(scan: _Side, reference: _Side, progress: Progress) -> tuple[NDArray[np.float64], float | None]:
    """Trimmed closest points from several starts, and how far another orientation lies that does as well.

    Of the orientations that explain the scan about equally well, the one nearest to the file's own is
    taken: whoever made the file rarely turned it upside down.
    """
    few = _thinned(scan, START_POINTS), _thinned(reference, START_POINTS)
    found = [
        _closest_points(*few, one, _overlapping, START_ITERATIONS, piece)
        for one, piece in progress.part(0.4, 0.8).over(_promising(scan, reference, progress.part(0.0, 0.4)))
    ]
    costs = np.array([_misfit_mm(*few, transform) for transform in found])
    best = _nearest_upright(found, costs)
    away = np.array([_angle_deg(other @ np.linalg.inv(found[best])) for other in found])
    rivals = np.flatnonzero((away > RIVAL_DEG) & (costs <= DOUBTFUL * costs[best]))
    transform = _closest_points(scan, reference, found[best], _overlapping, ICP_ITERATIONS, progress)
    progress.tell(1)
    return transform, float(away[rivals[costs[rivals].argmin()]]) if len(rivals) else None


def _promising(scan: _Side, reference: _Side, progress: Progress) -> list[NDArray[np.float64]]:
    """The best of many starts after some quick steps, no two alike."""
    clouds = _thinned(_as_cloud(scan), SCOUT_POINTS), _thinned(_as_cloud(reference), SCOUT_POINTS)
    rotations = [np.eye(3), *_turns(scan, reference)]
    starts = [np.eye(4)] + [start for rotation in rotations for start in _shifted(scan, reference, rotation)]
    tried = [
        _closest_points(*clouds, one, _overlapping, SCOUT_ITERATIONS, piece)
        for one, piece in progress.over(starts)
    ]
    few = _thinned(scan, SCOUT_POINTS), _thinned(reference, SCOUT_POINTS)
    centre, length_mm = scan.samples.mean(axis=0), float(np.ptp(reference.samples, axis=0).max())
    chosen: list[NDArray[np.float64]] = []
    for one in sorted(tried, key=lambda transform: _misfit_mm(*few, transform)):
        if len(chosen) < PROMISING and not any(_are_alike(one, other, centre, length_mm) for other in chosen):
            chosen.append(one)
    return chosen


def _are_alike(
    one: NDArray[np.float64], other: NDArray[np.float64], centre: NDArray[np.float64], length_mm: float
) -> bool:
    apart_mm = float(np.linalg.norm(_applied(one, centre) - _applied(other, centre)))
    return apart_mm < ALIKE_SHARE * length_mm and _angle_deg(one @ np.linalg.inv(other)) < ALIKE_DEG


def _nearest_upright(found: Sequence[NDArray[np.float64]], costs: NDArray[np.float64]) -> int:
    """Of the motions with about the least cost, the best of those that turn least."""
    close = np.flatnonzero(costs <= ALIKE * costs.min())
    angles = np.array([_angle_deg(transform) for transform in found])[close]
    upright = close[angles <= angles.min() + UPRIGHT_DEG]
    return int(upright[costs[upright].argmin()])


def _thinned(side: _Side, count: int) -> _Side:
    """Samples come in random order, so the first ones cover the shape as well."""
    return replace(side, samples=side.samples[:count])


def _misfit_mm(scan: _Side, reference: _Side, transform: NDArray[np.float64]) -> float:
    """The smallest of :func:`_overlap_costs` of all pairs, from both sides."""
    distances_mm = [pairs.distances_mm for pairs in _pairs(scan, reference, transform)]
    return float(_overlap_costs(np.concatenate(distances_mm)).min())


def _shifted(scan: _Side, reference: _Side, rotation: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Starts with centre on centre and moved along the reference's longest axis, where a part may lie."""
    middle = reference.samples.mean(axis=0) - rotation @ scan.samples.mean(axis=0)
    axis = _axes(reference.samples)[:, 0]
    length = float(np.ptp(reference.samples @ axis))
    return [_matrix(rotation, middle + share * length * axis) for share in START_SHIFTS]


def _turns(scan: _Side, reference: _Side) -> list[NDArray[np.float64]]:
    """The 24 rotations that lay principal axes on principal axes; of a part the longest may be another."""
    axes, goal = _axes(scan.samples), _axes(reference.samples)
    signed = [
        np.eye(3)[list(order)] * np.array(signs, float)
        for order in itertools.permutations(range(3))
        for signs in itertools.product((1, -1), repeat=3)
    ]
    return [goal @ turn @ axes.T for turn in signed if np.linalg.det(turn) > 0]


def _axes(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Principal axes as the columns of a rotation, the longest first."""
    axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2].T
    return axes * np.array([1.0, 1.0, np.linalg.det(axes)])


def _overlapping(distances_mm: NDArray[np.float64]) -> NDArray[np.bool_]:
    """The share of nearest pairs at which the fractional distance is least, so that a missing part drops out.

    Phillips, Liu and Tomasi, "Outlier robust ICP for minimizing fractional RMSD", 2007: root mean square
    of the share f, divided by f to a power; no share has to be given.
    """
    if not len(distances_mm):
        return np.zeros(0, dtype=bool)
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
    reference = _point_side(points, points, np.ones(len(points), dtype=bool))
    scan = _surface_side(mesh_mm, len(points))
    start = _matrix(np.eye(3), points.mean(axis=0) - scan.samples.mean(axis=0))
    return _closest_points(scan, reference, start, _everything, ICP_ITERATIONS, SILENT)


Nearest = Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.bool_]]]


@dataclass(frozen=True, eq=False)
class _Side:
    """One of the two shapes.

    Attributes:
        samples: points on it, ``[n, 3]``.
        nearest: to points ``[m, 3]`` the nearest ones on the shape, and whether such a pair is sound: it is
            not where the shape ends there and the other one may go on.
        cloud: points that stand for the shape where speed counts, ``[k, 3]``.
        sound: whether a pair with each of them is, ``[k]``.
    """

    samples: NDArray[np.float64]
    nearest: Nearest
    cloud: NDArray[np.float64]
    sound: NDArray[np.bool_]


def _scan_side(mesh_mm: trimesh.Trimesh, count: int) -> _Side:
    """A patient's: what lies beyond the rim of an open surface was not seen, nor what a cloud leaves out.

    Pairs on the rim are left out as by Turk and Levoy, "Zippered polygon meshes from range images", 1994.
    """
    if not len(mesh_mm.faces):
        vertices = np.asarray(mesh_mm.vertices, dtype=np.float64)
        order = np.random.default_rng(0).permutation(len(vertices))
        return _point_side(vertices[order[:count]], vertices, np.zeros(len(vertices), dtype=bool))
    return _surface_side(mesh_mm, count, np.unique(rim(mesh_mm)))


def _point_side(samples: NDArray[np.float64], points: NDArray[np.float64], sound: NDArray[np.bool_]) -> _Side:
    tree = cKDTree(points)

    def nearest(query: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        found = tree.query(query)[1]
        return points[found], sound[found]

    return _Side(samples, nearest, points, sound)


def _as_cloud(side: _Side) -> _Side:
    return _point_side(side.samples, side.cloud, side.sound)


def _surface_side(
    mesh_mm: trimesh.Trimesh, count: int, rim_vertices: NDArray[np.int64] | None = None
) -> _Side:
    """A surface; of an open one with the vertices on its rim."""
    vertices = np.ascontiguousarray(mesh_mm.vertices, dtype=np.float64)
    faces = np.ascontiguousarray(mesh_mm.faces, dtype=np.int64)
    at_rim = np.zeros(len(vertices), dtype=bool)
    at_rim[[] if rim_vertices is None else rim_vertices] = True
    inside: NDArray[np.bool_] = np.logical_not(at_rim[faces].any(axis=1))
    surface = igl.AABB()
    surface.init(vertices, faces)

    def nearest(query: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        _, face, points = surface.squared_distance(vertices, faces, query)
        return points, inside[face]

    samples = np.asarray(trimesh.sample.sample_surface(mesh_mm, count, seed=0)[0])
    dense = np.asarray(trimesh.sample.sample_surface(mesh_mm, SCOUT_CLOUD, seed=1)[0])
    cloud, edge = np.concatenate([dense, vertices[at_rim]]), int(at_rim.sum())
    return _Side(samples, nearest, cloud, np.arange(len(cloud)) < len(cloud) - edge)


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Points that are taken for each other.

    Attributes:
        scan: in the scan's own coordinates, ``[n, 3]``.
        reference: ``[n, 3]``.
        distances_mm: between them after the motion, ``[n]``.
    """

    scan: NDArray[np.float64]
    reference: NDArray[np.float64]
    distances_mm: NDArray[np.float64]


def _pairs(scan: _Side, reference: _Side, transform: NDArray[np.float64]) -> tuple[_Pairs, _Pairs]:
    """The sound pairs of the reference's samples with the scan, and of the scan's with the reference."""
    rotation, shift_mm = transform[:3, :3], transform[:3, 3]
    to_scan, seen = scan.nearest((reference.samples - shift_mm) @ rotation)
    to_reference, inside = reference.nearest(_applied(transform, scan.samples))
    return (
        _paired(to_scan[seen], reference.samples[seen], transform),
        _paired(scan.samples[inside], to_reference[inside], transform),
    )


def _paired(
    scan: NDArray[np.float64],
    reference: NDArray[np.float64],
    transform: NDArray[np.float64],
) -> _Pairs:
    return _Pairs(scan, reference, np.linalg.norm(_applied(transform, scan) - reference, axis=1))


Kept = Callable[[NDArray[np.float64]], NDArray[np.bool_]]
"""Which pairs of nearest points count, by their distances."""


def _everything(distances_mm: NDArray[np.float64]) -> NDArray[np.bool_]:
    return np.ones(len(distances_mm), dtype=bool)


def _closest_points(
    scan: _Side,
    reference: _Side,
    start: NDArray[np.float64],
    kept: Kept,
    iterations: int,
    progress: Progress,
) -> NDArray[np.float64]:
    """Iterative closest points in both directions at once (Besl and McKay, 1992).

    One direction alone drifts when the shapes differ in size: a small shape inside a large one is
    drawn to whichever wall is near.

    Args:
        scan: the shape to be moved.
        reference: the shape that it is moved onto.
        start: 4x4, scan to reference.
        kept: which of the sound pairs of each direction count.
        iterations: at most so many.
        progress: asked before every iteration whether anybody waits.

    Raises:
        Cancelled: when nobody waits any more.
    """
    rotation, shift_mm = start[:3, :3], start[:3, 3]
    for _ in range(iterations):
        progress.check()
        last = scan.samples @ rotation.T + shift_mm
        pairs = _pairs(scan, reference, _matrix(rotation, shift_mm))
        used = [kept(one.distances_mm) for one in pairs]
        points = np.concatenate([one.scan[use] for one, use in zip(pairs, used, strict=True)])
        goals = np.concatenate([one.reference[use] for one, use in zip(pairs, used, strict=True)])
        centre, goal = points.mean(axis=0), goals.mean(axis=0)
        rotation = _best_rotation(points - centre, goals - goal)
        shift_mm = goal - rotation @ centre
        if np.abs(scan.samples @ rotation.T + shift_mm - last).max() < ICP_TOLERANCE_MM:
            break
    return _matrix(rotation, shift_mm)


def _best_rotation(points: NDArray[np.float64], goals: NDArray[np.float64]) -> NDArray[np.float64]:
    """The rotation that lays ``points`` on ``goals``, both ``[n, 3]`` about 0 (Kabsch, 1976)."""
    left, _, right = np.linalg.svd(goals.T @ points)
    left[:, 2] *= np.linalg.det(left @ right)
    return np.asarray(left @ right)


def _matrix(rotation: NDArray[np.float64], shift_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, shift_mm
    return matrix
