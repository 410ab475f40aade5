"""One renderer with one surface, and how that is replaced."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import pyvista as pv

from naisr_viewer.state.requests import Colouring, SurfaceResult
from naisr_viewer.views.shapes.looks import (
    CUT_LINE_PX,
    MATT,
    NUMBERS_LINE_PX,
    SHINY,
    Cap,
    as_polydata,
    is_closed,
    look_up_table,
)


@dataclass(eq=False)
class SubPlot:
    """One renderer with one surface.

    Attributes:
        renderer: draws into its part of the canvas.
        actor: the surface's look.
        mesh: the surface as VTK knows it; its contents are replaced in place.
        colour: of the surface, ``#rrggbb``, where its vertices have none.
        result: what ``mesh`` was made from.
        ghost: the look of what lies over the surface.
        marks: the look of the places that are marked on it.
        cap: the look of what the section plane cuts; of curves in the plane, of what they enclose.
        is_pale: whether its colour is much like the ground.
        is_shown: whether it has a part of the canvas.
        is_stale: whether the canvas shows something else.
    """

    renderer: pv.Renderer
    actor: pv.Actor
    mesh: pv.PolyData
    colour: str
    result: SurfaceResult | None = None
    ghost: pv.Actor | None = None
    marks: pv.Actor | None = None
    cap: Cap | None = None
    is_pale: bool = False
    is_shown: bool = False
    is_stale: bool = True

    @property
    def is_outline(self) -> bool:
        """Whether curves in the plane are shown, around what they enclose."""
        return self.cap is not None and self.cap.outline is self.actor

    @property
    def boxes(self) -> list[tuple[float, ...]]:
        """Bounds of what is drawn, each x, y and z from and to (mm)."""
        boxes = [self.mesh.bounds] if self.mesh.n_points else []
        return [*boxes, self.ghost.bounds] if self.ghost is not None else boxes


def set_points(plot: SubPlot, old: SurfaceResult | None, result: SurfaceResult) -> None:
    """Replace the surface of a sub-plot, or only its vertices where it has the same triangles."""
    if old is not None and old.faces is result.faces and len(result.faces) and result.dim == 3:
        plot.mesh.points[:] = result.points_mm
        plot.mesh.point_data.active_normals[:] = result.normals
    else:
        plot.mesh.copy_from(as_polydata(result), deep=False)
        plot.actor.prop.culling = "back" if is_closed(result.faces) else "none"
        _fill(plot)


def set_nothing(plot: SubPlot) -> None:
    """Empty a sub-plot."""
    plot.mesh.copy_from(pv.PolyData(), deep=False)
    _fill(plot)
    plot.result = None


def _fill(plot: SubPlot) -> None:
    if plot.is_outline and plot.cap is not None:
        plot.cap.fill(plot.mesh)


def set_colouring(plot: SubPlot, colouring: Colouring | None) -> None:
    """Colour the vertices of a sub-plot, or all of it in its own colour."""
    mapper = plot.actor.mapper
    mapper.scalar_visibility = colouring is not None
    for name, value in (SHINY if colouring is None else MATT).items():
        setattr(plot.actor.prop, name, value)
    if plot.is_outline:
        plot.actor.prop.line_width = CUT_LINE_PX if colouring is None else NUMBERS_LINE_PX
    if colouring is not None:
        plot.mesh.point_data.set_scalars(colouring.values, "numbers")
        mapper.lookup_table = look_up_table(colouring.limit, colouring.scale)
        mapper.use_lookup_table_scalar_range = True


class Hit(NamedTuple):
    """What is seen of a surface at a pixel.

    Attributes:
        point_mm: the point.
        value: the number at the nearest vertex, in the unit of the surface's numbers; None where it has none.
    """

    point_mm: tuple[float, float, float]
    value: float | None


def picked(plot: SubPlot, x: float, y: float) -> Hit | None:
    """What a sub-plot's surface has at a pixel of the canvas, counted from below; None beside the surface."""
    picker = pv._vtk.vtkCellPicker()
    picker.SetTolerance(0.0)
    picker.PickFromListOn()
    picker.AddPickList(plot.actor)
    if plot.cap is not None:
        picker.AddPickList(plot.cap.filled)
    if not picker.Pick(x, y, 0.0, plot.renderer):
        return None
    if plot.is_outline:
        return _on_curve(plot, picker.GetPickPosition())
    if plot.cap is not None and picker.GetActor() is plot.cap.filled:
        return None  # what the section plane lays open is no surface
    first, second, third = picker.GetPickPosition()
    return Hit((first, second, third), _number(plot, picker.GetPointId()))


def _on_curve(plot: SubPlot, point_mm: tuple[float, float, float]) -> Hit:
    """The vertex of a curve that is nearest to a point which it encloses."""
    nearest = plot.mesh.find_closest_point(point_mm)
    first, second, third = plot.mesh.points[nearest].tolist()
    return Hit((first, second, third), _number(plot, nearest))


def _number(plot: SubPlot, vertex: int) -> float | None:
    numbers = None if plot.result is None else plot.result.colouring
    return None if numbers is None else float(numbers.values[vertex])
