"""Rigid alignment of scans to the atlas frame. Size is never changed.

``none`` leaves the coordinates as they are; ``landmarks`` puts one named landmark at the origin
and rotates about it; ``icp`` moves the surface onto reference points.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
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


def _closest_point_transform(alignment: Alignment, mesh_mm: trimesh.Trimesh) -> NDArray[np.float64]:
    """Iterative closest points in both directions at once, started with the centres matched.

    One direction alone drifts when the shapes differ in size: a small reference inside a large
    scan is drawn to whichever wall is near.
    """
    vertices = np.ascontiguousarray(mesh_mm.vertices, dtype=np.float64)
    faces = np.ascontiguousarray(mesh_mm.faces, dtype=np.int64)
    reference = np.array(list(alignment.reference.values()))
    scan = np.asarray(trimesh.sample.sample_surface(mesh_mm, len(reference), seed=0)[0])
    tree, surface = cKDTree(reference), igl.AABB()
    surface.init(vertices, faces)
    rotation, shift_mm = np.eye(3), reference.mean(axis=0) - scan.mean(axis=0)
    for _ in range(ICP_ITERATIONS):
        on_scan = surface.squared_distance(vertices, faces, (reference - shift_mm) @ rotation)[2]
        on_reference = reference[tree.query(scan @ rotation.T + shift_mm)[1]]
        points, goals = np.concatenate([on_scan, scan]), np.concatenate([reference, on_reference])
        centre, goal = points.mean(axis=0), goals.mean(axis=0)
        last = scan @ rotation.T + shift_mm
        rotation = Rotation.align_vectors(goals - goal, points - centre)[0].as_matrix()
        shift_mm = goal - rotation @ centre
        if np.abs(scan @ rotation.T + shift_mm - last).max() < ICP_TOLERANCE_MM:
            break
    return _matrix(rotation, shift_mm)


def _matrix(rotation: NDArray[np.float64], shift_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, shift_mm
    return matrix
