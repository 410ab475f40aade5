"""What can be measured of one shape: a measure is a value here and a line in :data:`MEASURES`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import igl
import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

from naisr_model.frames import Frame
from naisr_model.measures.tubes import Tube, tube_of
from naisr_model.shapes.kinds import KINDS, Shape, kind_of
from naisr_model.surface.volume import enclosed, enclosed_volume


@dataclass(frozen=True, eq=False)
class Surface:
    """What is measured: the surface of one shape, or its curve in the plane, millimetres.

    Attributes:
        points_mm: vertices, ``[n, dim]``.
        faces: vertex numbers of the triangles, outward by the right hand, or of the segments, ``[m, dim]``.
        is_closed: whether it bounds a body.
        tube: its stations; None where it is not tube-like.
    """

    points_mm: NDArray[np.floating]
    faces: NDArray[np.integer]
    is_closed: bool
    tube: Tube | None

    def moved(self, points_mm: NDArray[np.floating]) -> Surface:
        """The same material with its vertices elsewhere, ``[n, dim]``."""
        return replace(self, points_mm=points_mm)

    @property
    def mesh(self) -> Shape:
        """As a mesh or a curve with the same vertices."""
        return KINDS[self.points_mm.shape[1]].made(np.asarray(self.points_mm, dtype=np.float64), self.faces)


def surface_of(mesh: Shape) -> Surface:
    """A mesh or a curve in millimetres, the mesh with stations of its own where it is tube-like."""
    if kind_of(mesh).dim == 2:
        return Surface(mesh.vertices, mesh.faces, len(mesh.faces) > 0, None)
    return Surface(mesh.vertices, np.asarray(mesh.faces), bool(mesh.is_watertight), tube_of(mesh))


@dataclass(frozen=True)
class Measure:
    """One number that is measured of a shape.

    Attributes:
        name: as in files and commands.
        title: as people read it.
        unit: of the number.
        definition: how it is measured, in words.
        of: the number; only where it is possible.
        is_possible: whether a surface has such a thing.
    """

    name: str
    title: str
    unit: str
    definition: str
    of: Callable[[Surface], float]
    is_possible: Callable[[Surface], bool]


def _volume_cm3(surface: Surface) -> float:
    mesh = surface.mesh
    return enclosed_volume(mesh.vertices, mesh.vertex_normals, mesh.faces) / 1000


def _is_tube(surface: Surface) -> bool:
    return surface.tube is not None


def _length_mm(surface: Surface) -> float:
    assert surface.tube is not None
    return surface.tube.sections(surface.points_mm).length_mm


def _narrowest_mm2(surface: Surface) -> float:
    assert surface.tube is not None
    return float(surface.tube.sections(surface.points_mm).areas_mm2.min())


VOLUME = Measure(
    "volume",
    "Volume",
    "cm³",
    "inside the smooth surface through the vertices",
    _volume_cm3,
    lambda surface: surface.is_closed,
)

MEASURES: Mapping[str, Measure] = MappingProxyType(
    {
        measure.name: measure
        for measure in (
            VOLUME,
            Measure(
                "area",
                "Surface area",
                "cm²",
                "of all triangles",
                lambda surface: float(surface.mesh.area) / 100,
                lambda surface: len(surface.faces) > 0,
            ),
            Measure(
                "length",
                "Length",
                "mm",
                "of the centreline, which joins the centres of the rings around the tube, from end to end",
                _length_mm,
                _is_tube,
            ),
            Measure(
                "narrowest",
                "Narrowest cross-section",
                "mm²",
                "smallest area across the centreline, branches together, a radius or more from the ends",
                _narrowest_mm2,
                _is_tube,
            ),
        )
    }
)
"""By name. A new one is positive for every shape that has it: norms compare its logarithms."""


def measures_of(frame: Frame) -> Mapping[str, Measure]:
    """What can be measured of the shapes in a frame, by name: :data:`MEASURES`, or what curves have."""
    if frame.dim == 3:
        return MEASURES
    area = Measure(
        "area",
        "Area",
        frame.extent.unit,
        "inside the smooth curve through the vertices",
        lambda curve: enclosed(curve.mesh),
        lambda curve: curve.is_closed,
    )
    length = Measure(
        "length",
        "Length of the outline",
        frame.unit,
        "of all segments",
        lambda curve: float(curve.mesh.area),
        lambda curve: len(curve.faces) > 0,
    )
    return MappingProxyType({measure.name: measure for measure in (area, length)})


@dataclass(frozen=True)
class Anchor:
    """A material point: a place on a triangle of the template.

    Attributes:
        corners: vertex numbers of the triangle.
        weights: of the corners; they add up to 1.
    """

    corners: tuple[int, int, int]
    weights: tuple[float, float, float]

    def place_mm(self, surface: Surface) -> NDArray[np.float64]:
        """Where it is in a shape with the template's vertices, ``[dim]``."""
        return np.asarray(np.array(self.weights) @ surface.points_mm[list(self.corners)], dtype=np.float64)


def anchor(template: Surface, point_mm: ArrayLike) -> Anchor:
    """The material point of a template that is nearest to ``point_mm [3]``."""
    point = np.asarray(point_mm, dtype=np.float64).reshape(1, 3)
    points, faces = np.asarray(template.points_mm, np.float64), np.asarray(template.faces, np.int64)
    _, face, nearest = igl.point_mesh_squared_distance(point, points, faces)
    corners = faces[int(np.ravel(face)[0])]
    weights = trimesh.triangles.points_to_barycentric(points[corners][None], nearest.reshape(1, 3))[0]
    a, b, c = corners.tolist()
    u, v, w = weights.tolist()
    return Anchor((a, b, c), (u, v, w))


def distance(first: Anchor, second: Anchor, *, unit: str = "mm") -> Measure:
    """How far apart two material points are, in a straight line and in the unit of their frame."""
    return Measure(
        "distance",
        "Distance",
        unit,
        "between two material points, in a straight line",
        lambda shape: float(np.linalg.norm(first.place_mm(shape) - second.place_mm(shape))),
        lambda shape: len(shape.points_mm) > max(*first.corners, *second.corners),
    )


def measured(surface: Surface) -> dict[str, float]:
    """Everything that can be measured of a surface, by the names of :data:`MEASURES`."""
    return {name: one.of(surface) for name, one in MEASURES.items() if one.is_possible(surface)}
