"""The geometry of the synthetic airway: elliptical tubes along smooth centrelines, as one surface.

Anatomical frame in millimetres: x to the left, y backwards (posterior), z upwards; the origin is the
middle of the true vocal cords. Of an adult the airway reaches from z = -122 (carina) to z = 112
(roof of the nose) and forwards to y = -87 (nostrils).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pyvista as pv
import trimesh
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from naisr_model.data.populations.airway_growth import Sizes, smooth_step

Array = NDArray[np.float64]

# Adult reference. Columns: x, y, z of the centreline; lateral and sagittal half-axis of the section.
_TRACT = np.array(
    [
        [0, 7, 99, 12.5, 9.0],  # roof of the nasopharynx
        [0, 12, 84, 15.0, 10.0],
        [0, 12, 64, 13.5, 8.0],  # behind the soft palate
        [0, 8, 45, 15.0, 9.0],  # oropharynx
        [0, 3, 26, 14.0, 8.5],  # tip of the epiglottis
        [0, 0.5, 11, 10.5, 8.5],
        [0, 0, 0, 6.8, 9.0],  # true vocal cords
        [0, 2, -14, 8.2, 9.2],  # subglottis
        [0, 8, -45, 9.0, 9.2],
        [0, 16, -80, 9.0, 9.2],
        [0, 25, -113, 9.8, 9.2],  # carina
    ]
)
_LEFT_NASAL_PASSAGE = np.array(
    [
        [8.5, -80, 74, 6.2, 7.0],  # nostril
        [9.5, -71, 88, 6.8, 9.0],
        [10, -54, 97, 7.2, 12.0],
        [10, -32, 99, 7.2, 13.0],
        [9.5, -12, 96, 7.2, 11.5],  # choana
        [7.5, 2, 90, 7.0, 9.5],
        [5, 9, 80, 6.0, 7.0],  # ends inside the nasopharynx
    ]
)
# Scales all sections so that the reference has the volume of the oldest age of the growth path.
_SECTION_SCALE = 0.945

_SAMPLES_PER_TUBE = 400
_GRID_STEPS = 170
_BLEND_MM = 4.0
# Bone holds the nasal passages: individuals differ less there, and the two never meet before the choanae.
_NASAL_SHARE_OF_CALIBRE = 0.4
_PHARYNX_MM = (18.0, 34.0, 72.0, 92.0)
_LARYNX_MM = (-48.0, -8.0, 2.0, 24.0)
_NECK_MM = (8.0, 72.0)
_NECK_PIVOT_MM = (0.0, 3.0, 20.0)
_NOSE_MM = (-14.0, -44.0)
_NOSE_PIVOT_MM = (0.0, -12.0, 96.0)


@dataclass(frozen=True)
class Variation:
    """What makes one visit differ from the population's usual shape; all 0 is that usual shape.

    Attributes:
        log_calibre: logarithm of a factor on all sections.
        log_length: logarithm of a factor on all centrelines.
        log_pharynx: logarithm of a further factor on the sections of the pharynx.
        neck_forward_deg: bend of the part above the larynx in the sagittal plane (posture, flexion).
        neck_sideways_deg: bend of the same part towards a shoulder.
        nose_deg: tilt of the nasal passages about the choanae.
    """

    log_calibre: float = 0.0
    log_length: float = 0.0
    log_pharynx: float = 0.0
    neck_forward_deg: float = 0.0
    neck_sideways_deg: float = 0.0
    nose_deg: float = 0.0


@dataclass(frozen=True, eq=False)
class _Tube:
    """A sampled centreline with its sections: points ``[n, 3]``, half-axes ``[n]`` (mm)."""

    points: Array
    lateral: Array
    sagittal: Array


@cache
def _reference(name: str) -> _Tube:
    rows = _TRACT if name == "tract" else _LEFT_NASAL_PASSAGE
    knots = _chord_lengths(rows[:, :3])
    at = np.linspace(0.0, knots[-1], _SAMPLES_PER_TUBE)
    points = CubicSpline(knots, rows[:, :3])(at) * ((-1.0, 1.0, 1.0) if name == "right" else 1.0)
    half_axes = PchipInterpolator(knots, rows[:, 3:] * _SECTION_SCALE)(at)
    return _Tube(points, half_axes[:, 0], half_axes[:, 1])


def _chord_lengths(points: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def _plateau(heights: Array, rise_from: float, rise_to: float, fall_from: float, fall_to: float) -> Array:
    return smooth_step(heights, rise_from, rise_to) * (1.0 - smooth_step(heights, fall_from, fall_to))


def _scaled(name: str, sizes: Sizes, variation: Variation) -> _Tube:
    """A reference tube at its size, before the head is turned."""
    tube = _reference(name)
    heights = tube.points[:, 2]
    in_tract, in_nose = _tract_calibre(heights, sizes, variation), _nasal_calibre(sizes, variation)
    calibre = in_tract if name == "tract" else in_nose
    length = sizes.length * np.exp(variation.log_length)
    return _Tube(tube.points * length, tube.lateral * calibre, tube.sagittal * calibre)


def _tract_calibre(heights: Array, sizes: Sizes, variation: Variation) -> Array:
    """Scale of the sections at heights ``[n]`` of the adult reference."""
    pharynx = np.exp(variation.log_pharynx * _plateau(heights, *_PHARYNX_MM))
    larynx = 1.0 + (sizes.larynx - 1.0) * _plateau(heights, *_LARYNX_MM)
    return sizes.calibre * np.exp(variation.log_calibre) * pharynx * larynx


def _nasal_calibre(sizes: Sizes, variation: Variation) -> float:
    return sizes.nasal_calibre * float(np.exp(_NASAL_SHARE_OF_CALIBRE * variation.log_calibre))


def _turned(points: Array, amount: Array, angles_deg: tuple[float, float, float], pivot: Array) -> Array:
    """Rotate each point about ``pivot`` by its own ``amount`` (0 to 1) of a rotation vector."""
    rotations = Rotation.from_rotvec(amount[:, None] * np.radians(angles_deg))
    return rotations.apply(points - pivot) + pivot


def _posed(points: Array, length: float, variation: Variation) -> Array:
    """Tilt the nose and bend the neck of points ``[n, 3]`` of an airway of that length scale."""
    nose_share = smooth_step(-points[:, 1], -_NOSE_MM[0] * length, -_NOSE_MM[1] * length)
    points = _turned(points, nose_share, (variation.nose_deg, 0.0, 0.0), np.multiply(_NOSE_PIVOT_MM, length))
    neck_share = smooth_step(points[:, 2], _NECK_MM[0] * length, _NECK_MM[1] * length)
    angles = (variation.neck_forward_deg, variation.neck_sideways_deg, 0.0)
    return _turned(points, neck_share, angles, np.multiply(_NECK_PIVOT_MM, length))


def _tube(name: str, sizes: Sizes, variation: Variation) -> _Tube:
    tube = _scaled(name, sizes, variation)
    length = sizes.length * float(np.exp(variation.log_length))
    return replace(tube, points=_posed(tube.points, length, variation))


def _frames(points: Array) -> tuple[Array, Array, Array]:
    """Unit tangents, lateral and sagittal directions along a centreline, each ``[n, 3]``."""
    tangents = np.gradient(points, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    lateral = np.array([1.0, 0.0, 0.0]) - tangents[:, :1] * tangents
    lateral /= np.linalg.norm(lateral, axis=1, keepdims=True)
    return tangents, lateral, np.cross(tangents, lateral)


def _tube_field(tube: _Tube, nodes: Array, reach: float) -> Array:
    """About the signed distance (mm, negative inside) of nodes ``[m, 3]``; ``reach`` where farther away.

    First-order distance to an ellipse, ``k (k - 1) / |grad|``; its zero set is exact. Beyond an end
    the section's third axis makes an ellipsoid, which rounds the end.
    """
    distance, nearest = cKDTree(tube.points).query(nodes, distance_upper_bound=reach)
    field = np.full(len(nodes), reach)
    near = np.flatnonzero(np.isfinite(distance))
    nearest = nearest[near]
    offset = nodes[near] - tube.points[nearest]
    along, across, depth = (np.einsum("ij,ij->i", offset, axis[nearest]) for axis in _frames(tube.points))
    arc = _chord_lengths(tube.points)
    position = arc[nearest] + along
    beyond = position - np.clip(position, 0.0, arc[-1])
    a = np.interp(position, arc, tube.lateral)
    b = np.interp(position, arc, tube.sagittal)
    c = np.minimum(a, b)
    radius = np.sqrt((across / a) ** 2 + (depth / b) ** 2 + (beyond / c) ** 2)
    slope = np.sqrt((across / a**2) ** 2 + (depth / b**2) ** 2 + (beyond / c**2) ** 2)
    field[near] = np.where(slope > 1e-9, radius * (radius - 1.0) / np.maximum(slope, 1e-9), -c)
    return field


def _smooth_union(first: Array, second: Array, blend: float) -> Array:
    """Minimum of two distances with the crease filleted over ``blend`` (polynomial smooth minimum)."""
    overlap = np.maximum(blend - np.abs(first - second), 0.0) / blend
    return np.minimum(first, second) - overlap**2 * blend / 4.0


def _grid_axes(tubes: list[_Tube], margin: float) -> list[Array]:
    points = np.concatenate([tube.points for tube in tubes])
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    spacing = float((high - low).max()) / _GRID_STEPS
    return [lo + spacing * np.arange(int((hi - lo) / spacing) + 2) for lo, hi in zip(low, high, strict=True)]


def _block(tube: _Tube, axes: list[Array], margin: float) -> tuple[slice, slice, slice]:
    """The part of the grid that a tube can reach."""
    low, high = tube.points.min(axis=0) - margin, tube.points.max(axis=0) + margin
    x, y, z = (slice(*np.searchsorted(axis, (lo, hi))) for axis, lo, hi in zip(axes, low, high, strict=True))
    return x, y, z


def _field(tubes: list[_Tube], axes: list[Array], reach: float, blend: float) -> Array:
    """The union's field on the grid ``[nx, ny, nz]``."""
    field = np.full([len(axis) for axis in axes], reach)
    for tube in tubes:
        block = _block(tube, axes, reach)
        sub_axes = [axis[part] for axis, part in zip(axes, block, strict=True)]
        nodes = np.stack(np.meshgrid(*sub_axes, indexing="ij"), axis=-1)
        own = _tube_field(tube, nodes.reshape(-1, 3), reach).reshape(nodes.shape[:3])
        field[block] = _smooth_union(field[block], own, blend)
    return field


def _isosurface(field: Array, axes: list[Array]) -> trimesh.Trimesh:
    spacing = axes[0][1] - axes[0][0]
    grid = pv.ImageData(dimensions=field.shape, spacing=(spacing,) * 3, origin=[axis[0] for axis in axes])
    grid["field"] = field.ravel(order="F")
    surface = grid.contour([0.0], scalars="field", method="flying_edges", compute_normals=False)
    # A field that is negative inside comes out with inward faces.
    faces = surface.faces.reshape(-1, 4)[:, :0:-1]
    return trimesh.Trimesh(np.asarray(surface.points, dtype=np.float64), faces, process=False)


def airway_mesh(sizes: Sizes, variation: Variation) -> trimesh.Trimesh:
    """One closed, connected surface in the anatomical frame, millimetres, outward faces."""
    tubes = [_tube(name, sizes, variation) for name in ("tract", "left", "right")]
    blend = _BLEND_MM * sizes.calibre
    widest = max(float(np.maximum(tube.lateral, tube.sagittal).max()) for tube in tubes)
    reach = 1.1 * widest + 1.5 * blend
    axes = _grid_axes(tubes, 1.1 * widest)
    return _isosurface(_field(tubes, axes, reach, blend), axes)


_LANDMARKS = {
    "left nostril": ("left", _LEFT_NASAL_PASSAGE[0]),
    "right nostril": ("right", _LEFT_NASAL_PASSAGE[0]),
    "left choana": ("left", _LEFT_NASAL_PASSAGE[4]),
    "right choana": ("right", _LEFT_NASAL_PASSAGE[4]),
    "nasopharynx": ("tract", _TRACT[1]),
    "oropharynx": ("tract", _TRACT[3]),
    "epiglottis tip": ("tract", _TRACT[4]),
    "true vocal cords": ("tract", _TRACT[6]),
    "subglottis": ("tract", _TRACT[7]),
    "mid-trachea": ("tract", _TRACT[8]),
    "carina": ("tract", _TRACT[10]),
}


def airway_landmarks(sizes: Sizes, variation: Variation) -> dict[str, tuple[float, float, float]]:
    """The eleven named points (mm) on the centrelines; the true vocal cords are the origin."""
    length = sizes.length * float(np.exp(variation.log_length))
    mirror = [(-1.0 if tube == "right" else 1.0, 1.0, 1.0) for tube, _ in _LANDMARKS.values()]
    reference = np.array([row[:3] for _, row in _LANDMARKS.values()]) * mirror
    points = _posed(reference * length, length, variation)
    return {name: (float(x), float(y), float(z)) for name, (x, y, z) in zip(_LANDMARKS, points, strict=True)}
