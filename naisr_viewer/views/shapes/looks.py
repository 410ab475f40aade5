"""How surfaces look: their polygons, their light, the colours of their vertices, and ghosts over them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from naisr_viewer.state.requests import Scale, SurfaceResult
from naisr_viewer.state.section import Cut
from naisr_viewer.views.colours import SCALE_COLOURS, blend

TABLE_COLOURS = 256
"""Colours of a scale that OpenGL is told; enough to look like a gradient."""

SHINY = {"ambient": 0.25, "diffuse": 0.9, "specular": 0.2, "specular_power": 25}
"""Light on a plain surface."""

MATT = {"ambient": 0.45, "diffuse": 0.6, "specular": 0.0}
"""Light on a surface whose colours are to be compared with a colour bar."""

POINT_PX = 5
GHOST_POINT_PX, GHOST_LINE_PX = 3, 2
"""Diameter of the points of a cloud, and width of an outline that lies over a shape."""

MARK_PX = 11
"""Diameter of the dot at a marked place."""

CUT_LINE_PX, NUMBERS_LINE_PX = 2, 6
INK, INKINESS = "#000000", 0.45
"""Width of an outline, wider where it has numbers as colours, and how much darker than the surface it is."""

GHOST_OPACITY = 0.35
GHOST_DEPTH = 80.0
"""By how much a ghost is drawn farther away, in VTK's units, of which 65,000 span the depth of the view:
where it as good as touches the shape, which of them is in front would be left to chance."""


def is_closed(faces: NDArray[np.int64]) -> bool:
    """Whether every edge is passed once in each direction, so that no back face can be seen from outside.

    Args:
        faces: vertex numbers of triangles, ``[m, 3]``; segments have no sides.
    """
    if len(faces) == 0 or faces.shape[1] == 2:
        return False
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    count = int(faces.max()) + 1
    return bool(np.array_equal(np.sort(start * count + end), np.sort(end * count + start)))


def as_polydata(result: SurfaceResult) -> pv.PolyData:
    """The surface with its normals; vertices are copied, because later frames overwrite them in place."""
    if is_cloud(result.points_mm, result.faces):
        return pv.PolyData(in_space(result.points_mm))
    if len(result.faces) == 0:
        return pv.PolyData()
    if result.dim == 2:
        return as_lines(result.points_mm, result.faces)
    mesh = pv.PolyData.from_regular_faces(result.points_mm.copy(), result.faces)
    mesh.point_data.active_normals = result.normals.copy()
    return mesh


def in_space(points: NDArray[np.float32]) -> NDArray[np.float32]:
    """A copy of points ``[n, dim]``, ``[n, 3]``; those in the plane have z = 0."""
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1])))


def as_lines(points: NDArray[np.float32], segments: NDArray[np.int64]) -> pv.PolyData:
    """A curve in the plane: ``[n, 2]``, and the numbers of its segments' ends, ``[m, 2]``."""
    return pv.PolyData(in_space(points), lines=np.insert(segments, 0, 2, axis=1).ravel())


def is_cloud(points_mm: NDArray[np.float32], faces: NDArray[np.int64]) -> bool:
    """Whether these are points without a surface."""
    return len(points_mm) > 0 and len(faces) == 0


def look_up_table(limit: float, scale: Scale) -> pv.LookupTable:
    """The colours of a scale for VTK; values beyond its ends have the colours of the ends."""
    stops = np.array([pv.Color(colour).int_rgb for colour in SCALE_COLOURS[scale]], float)
    places = np.linspace(0, len(stops) - 1, TABLE_COLOURS)
    colours = [np.interp(places, range(len(stops)), channel) for channel in stops.T]
    table = pv.LookupTable(n_values=TABLE_COLOURS)
    table.values = np.stack([*colours, np.full(TABLE_COLOURS, 255.0)], axis=1).round().astype(np.uint8)
    table.scalar_range = (-limit if scale == "signed" else 0.0, limit)
    return table


def as_ghost(points_mm: NDArray[np.float32], faces: NDArray[np.int64]) -> pv.Actor:
    """The look of a scan that lies over a shape: translucent, or dots where it has no surface.

    Of a closed surface only the side towards the eye is drawn, so that no two layers are ever mixed in the
    wrong order.
    """
    if is_cloud(points_mm, faces):
        actor = pv.Actor(mapper=pv.DataSetMapper(pv.PolyData(in_space(points_mm))))
        actor.prop.point_size, actor.prop.lighting = GHOST_POINT_PX, False
        return actor
    if faces.shape[1] == 2:
        return _as_outline(points_mm, faces)
    mesh = pv.PolyData.from_regular_faces(points_mm, faces)
    mesh.compute_normals(cell_normals=False, split_vertices=False, consistent_normals=False, inplace=True)
    actor = pv.Actor(mapper=pv.DataSetMapper(mesh))
    actor.mapper.scalar_visibility = False
    actor.mapper.SetResolveCoincidentTopologyToPolygonOffset()
    actor.mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(0.0, GHOST_DEPTH)
    actor.prop.interpolation, actor.prop.ambient, actor.prop.specular = "Phong", 0.5, 0.0
    actor.prop.opacity = GHOST_OPACITY
    actor.prop.culling = "back" if is_closed(faces) else "none"
    return actor


def _as_outline(points_mm: NDArray[np.float32], segments: NDArray[np.int64]) -> pv.Actor:
    """The look of an outline that lies over a shape in the plane."""
    actor = pv.Actor(mapper=pv.DataSetMapper(as_lines(points_mm, segments)))
    actor.prop.lighting, actor.prop.line_width = False, GHOST_LINE_PX
    _lift(actor, 2)
    return actor


def _lift(actor: pv.Actor, layers: int) -> None:
    """Draw lines and points before what lies at the same depth."""
    actor.mapper.SetResolveCoincidentTopologyToPolygonOffset()
    actor.mapper.SetRelativeCoincidentTopologyLineOffsetParameters(0.0, -layers * GHOST_DEPTH)
    actor.mapper.SetRelativeCoincidentTopologyPointOffsetParameter(-layers * GHOST_DEPTH)


def as_marks(points_mm: NDArray[np.float32], colours: Sequence[str]) -> pv.Actor:
    """Dots at places ``[n, 3]``, one of each colour (``#rrggbb``)."""
    dots = pv.PolyData(np.asarray(points_mm, np.float32))
    dots.point_data["colours"] = np.array([pv.Color(colour).int_rgb for colour in colours], np.uint8)
    mapper = pv.DataSetMapper(dots)
    mapper.set_scalars(dots.point_data["colours"], "colours", rgb=True)
    actor = pv.Actor(mapper=mapper)
    actor.prop.point_size, actor.prop.render_points_as_spheres = MARK_PX, True
    actor.prop.lighting = False
    actor.pickable = False
    _lift(actor, 3)
    return actor


class Cap(NamedTuple):
    """The look of what a plane lays open of a surface, or of a curve in the plane: without light.

    Attributes:
        filled: the inside.
        outline: a line around it, which also covers the seam.
    """

    filled: pv.Actor
    outline: pv.Actor

    def show(self, cut: Cut | None) -> None:
        """Fill what is closed, and draw all outlines; None takes both away."""
        outline = pv.PolyData() if cut is None else outline_of(cut)
        is_closed = cut is not None and cut.area_mm2 is not None and len(cut.lines) > 0
        self.filled.mapper.dataset.copy_from(fill(outline) if is_closed else pv.PolyData(), deep=False)
        self.outline.mapper.dataset.copy_from(outline, deep=False)

    def fill(self, outline: pv.PolyData) -> None:
        """Fill what closed lines enclose, which are drawn already."""
        self.filled.mapper.dataset.copy_from(fill(outline), deep=False)

    def colour(self, colour: str) -> None:
        """In the colour of the surface (``#rrggbb``), the line darker."""
        self.filled.prop.color, self.outline.prop.color = colour, blend(colour, INK, INKINESS)


def make_cap(outline: pv.Actor | None = None) -> Cap:
    """One that is still empty.

    Args:
        outline: what draws the lines; made when left out.
    """
    cap = Cap(_empty(), outline or _empty())
    for actor in cap:
        actor.prop.lighting, actor.prop.line_width = False, CUT_LINE_PX
        actor.mapper.SetResolveCoincidentTopologyToPolygonOffset()
    _lift(cap.outline, 1)
    return cap


def _empty() -> pv.Actor:
    return pv.Actor(mapper=pv.DataSetMapper(pv.PolyData()))


def outline_of(cut: Cut) -> pv.PolyData:
    """The lines of a cut."""
    if len(cut.lines) == 0:
        return pv.PolyData()
    return pv.PolyData(cut.points_mm, lines=np.insert(cut.lines, 0, 2, axis=1).ravel())


def fill(outline: pv.PolyData) -> pv.PolyData:
    """What closed lines enclose, as triangles."""
    if not outline.n_lines:
        return pv.PolyData()
    triangles = pv._vtk.vtkContourTriangulator()
    triangles.SetInputData(outline)
    triangles.Update()
    return pv.wrap(triangles.GetOutput())


def clip(actor: pv.Actor, plane: pv._vtk.vtkPlane | None) -> None:
    """Draw only what lies on the side of a plane that its normal points to; None draws all."""
    actor.mapper.RemoveAllClippingPlanes()
    if plane is not None:
        actor.mapper.AddClippingPlane(plane)
