"""What draws the sub-plots, loaded behind the window. The only user of pyvistaqt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QMouseEvent
from PySide6.QtWidgets import QWidget
from pyvistaqt import QtInteractor

from naisr_viewer.state.requests import Colouring, SurfaceResult
from naisr_viewer.views.colours import scale_colours

REST_SAMPLES = 4
"""Multi-sampling at rest; none while something moves, where it costs two thirds of a frame."""

TABLE_COLOURS = 256
"""Colours of a scale that OpenGL is told; enough to look like a gradient."""

SHINY = {"ambient": 0.25, "diffuse": 0.9, "specular": 0.2, "specular_power": 25}
"""Light on a plain surface."""

MATT = {"ambient": 0.45, "diffuse": 0.6, "specular": 0.0}
"""Light on a surface whose colours are to be compared with a colour bar."""

POINT_PX = 5
GHOST_POINT_PX = 3
"""Diameter of the points of a cloud."""

GHOST_OPACITY = 0.35
GHOST_DEPTH = 80.0
"""By how much a ghost is drawn farther away, in VTK's units, of which 65,000 span the depth of the view:
where it as good as touches the shape, which of them is in front would be left to chance."""

Viewport = tuple[float, float, float, float]
"""Left, bottom, right and top as shares of the canvas, counted from its lower left corner."""

Direction = tuple[float, float, float]


def is_closed(faces: NDArray[np.int64]) -> bool:
    """Whether every edge is passed once in each direction, so that no back face can be seen from outside.

    Args:
        faces: vertex numbers of triangles, ``[m, 3]``.
    """
    if len(faces) == 0:
        return False
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    count = int(faces.max()) + 1
    return bool(np.array_equal(np.sort(start * count + end), np.sort(end * count + start)))


def as_polydata(result: SurfaceResult) -> pv.PolyData:
    """The surface with its normals; vertices are copied, because later frames overwrite them in place."""
    if is_cloud(result.points_mm, result.faces):
        return pv.PolyData(result.points_mm.copy())
    if len(result.faces) == 0:
        return pv.PolyData()
    mesh = pv.PolyData.from_regular_faces(result.points_mm.copy(), result.faces)
    mesh.point_data.active_normals = result.normals.copy()
    return mesh


def is_cloud(points_mm: NDArray[np.float32], faces: NDArray[np.int64]) -> bool:
    """Whether these are points without a surface."""
    return len(points_mm) > 0 and len(faces) == 0


def look_up_table(limit_mm: float, is_signed: bool) -> pv.LookupTable:
    """The colours of a scale for VTK; values beyond its ends have the colours of the ends."""
    stops = np.array([pv.Color(colour).int_rgb for colour in scale_colours(is_signed)], float)
    places = np.linspace(0, len(stops) - 1, TABLE_COLOURS)
    colours = [np.interp(places, range(len(stops)), channel) for channel in stops.T]
    table = pv.LookupTable(n_values=TABLE_COLOURS)
    table.values = np.stack([*colours, np.full(TABLE_COLOURS, 255.0)], axis=1).round().astype(np.uint8)
    table.scalar_range = (-limit_mm if is_signed else 0.0, limit_mm)
    return table


def as_ghost(points_mm: NDArray[np.float32], faces: NDArray[np.int64]) -> pv.Actor:
    """The look of a scan that lies over a shape: translucent, or dots where it has no surface.

    Of a closed surface only the side towards the eye is drawn, so that no two layers are ever mixed in the
    wrong order.
    """
    if is_cloud(points_mm, faces):
        actor = pv.Actor(mapper=pv.DataSetMapper(pv.PolyData(points_mm)))
        actor.prop.point_size, actor.prop.lighting = GHOST_POINT_PX, False
        return actor
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


def aim(camera: pv.Camera, box_mm: NDArray[np.float64]) -> None:
    """Look at the middle of a box ``[3, 2]`` from well outside, keeping the direction."""
    direction = np.subtract(camera.position, camera.focal_point)
    distance = 3 * np.linalg.norm(box_mm[:, 1] - box_mm[:, 0])
    centre = box_mm.mean(axis=1)
    camera.position = centre + direction / np.linalg.norm(direction) * distance
    camera.focal_point = centre


def seen_size(camera: pv.Camera, box_mm: NDArray[np.float64]) -> tuple[float, float]:
    """Width and height in millimetres of a box ``[3, 2]`` as the camera sees it."""
    forward = np.subtract(camera.focal_point, camera.position)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward / np.linalg.norm(forward))
    size = box_mm[:, 1] - box_mm[:, 0]
    return float(np.abs(right) @ size), float(np.abs(up) @ size)


@dataclass(eq=False)
class SubPlot:
    """One renderer with one surface.

    Attributes:
        renderer: draws into its part of the canvas.
        actor: the surface's look.
        mesh: the surface as VTK knows it; its contents are replaced in place.
        result: what ``mesh`` was made from.
        ghost: the look of what lies over the surface.
        is_shown: whether it has a part of the canvas.
        is_stale: whether the canvas shows something else.
    """

    renderer: pv.Renderer
    actor: pv.Actor
    mesh: pv.PolyData
    result: SurfaceResult | None = None
    ghost: pv.Actor | None = None
    is_shown: bool = False
    is_stale: bool = True

    @property
    def boxes(self) -> list[tuple[float, ...]]:
        """Bounds of what is drawn, each x, y and z from and to (mm)."""
        boxes = [self.mesh.bounds] if self.mesh.n_points else []
        return [*boxes, self.ghost.bounds] if self.ghost is not None else boxes


class Canvas(QtInteractor):
    """A row of sub-plots that draws what changed, once per change, when Qt asks it to paint.

    VTK draws into a frame buffer of its own, which keeps the sub-plots that are not drawn again.

    Args:
        colours: one sub-plot, still empty and hidden, for each of these (``#rrggbb``).
        parent: the widget around it.
    """

    drawn = Signal(int)  # the picture is on its way to the screen; how many sub-plots were drawn anew
    held = Signal(bool)  # whether the mouse holds the shapes

    def __init__(self, colours: Sequence[str], parent: QWidget) -> None:
        self._plots: list[SubPlot] = []
        self._ghost_colour = "#000000"
        super().__init__(
            parent, shape=(1, len(colours)), border=False, auto_update=False, multi_samples=REST_SAMPLES
        )
        self.setAcceptDrops(False)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._requests = self.iren.interactor.AddObserver("RenderEvent", self._render_requested)
        self.iren.interactor.EnableRenderOff()
        self._plots = [self._sub_plot(index, colour) for index, colour in enumerate(colours)]
        self.link_views()
        self.enable_parallel_projection()

    def set_surface(self, index: int, result: SurfaceResult) -> None:
        """Show a surface; where only its vertices moved, nothing else is sent to OpenGL again."""
        plot = self._plots[index]
        old, plot.result = plot.result, result
        is_same = old is not None and old.points_mm is result.points_mm and old.faces is result.faces
        if old is not None and is_same and old.colouring is result.colouring:
            return
        if not is_same:
            _move(plot, old, result)
        _colour(plot, result.colouring)
        plot.is_stale = True
        self.update()

    def clear_surface(self, index: int) -> None:
        """Show nothing until the next surface comes."""
        plot = self._plots[index]
        plot.result = None
        plot.mesh.copy_from(pv.PolyData(), deep=False)
        plot.is_stale = True
        self.update()

    def set_ghost(self, index: int, points_mm: NDArray[np.float32] | None, faces: NDArray[np.int64]) -> None:
        """Lay a scan over a surface; no points remove it."""
        plot = self._plots[index]
        if plot.ghost is not None:
            plot.renderer.remove_actor(plot.ghost, render=False)
        plot.ghost = None if points_mm is None else as_ghost(points_mm, faces)
        if plot.ghost is not None:
            plot.ghost.prop.color = self._ghost_colour
            plot.renderer.add_actor(plot.ghost, render=False, reset_camera=False)
        plot.is_stale = True
        self.update()

    def box_mm(self) -> NDArray[np.float64] | None:
        """Bounds of all that is shown, ``[3, 2]``; None where there is nothing."""
        boxes = [box for plot in self._plots if plot.is_shown for box in plot.boxes]
        if not boxes:
            return None
        return np.stack([np.min(boxes, axis=0)[::2], np.max(boxes, axis=0)[1::2]], axis=1)

    def set_colours(self, background: str, ghost: str) -> None:
        """Colour what is behind the surfaces and what lies over them (``#rrggbb``)."""
        self._ghost_colour = ghost
        for plot in self._plots:
            plot.renderer.set_background(background)
            if plot.ghost is not None:
                plot.ghost.prop.color = ghost
        self.refresh()

    def set_viewports(self, viewports: Sequence[Viewport | None]) -> None:
        """Say where each sub-plot is; None hides it."""
        for plot, viewport in zip(self._plots, viewports, strict=True):
            plot.is_shown = viewport is not None
            plot.renderer.SetInteractive(plot.is_shown)
            if viewport is not None:
                plot.renderer.SetViewport(*viewport)
        self.refresh()

    def set_smooth(self, smooth: bool) -> None:
        """Draw quickly while something moves, smoothly at rest."""
        samples = REST_SAMPLES if smooth else 0
        if self.ren_win.GetMultiSamples() != samples:
            self.ren_win.SetMultiSamples(samples)
            self.refresh()

    def look(self, direction: Direction, up: Direction) -> None:
        """Stand in this direction from the middle."""
        self.camera.focal_point, self.camera.position, self.camera.up = (0, 0, 0), direction, up
        self.refresh()

    def frame(self, box_mm: NDArray[np.float64]) -> tuple[float, float]:
        """Look at the middle of ``box_mm`` ``[3, 2]``; returns its width and height as seen (mm)."""
        aim(self.camera, box_mm)
        self.refresh()
        return seen_size(self.camera, box_mm)

    def refresh(self) -> None:
        """Draw everything again with the next painting."""
        for plot in self._plots:
            plot.is_stale = True
        self.update()

    def initializeGL(self) -> None:
        """Start with a new frame buffer."""
        super().initializeGL()
        self.refresh()

    def resizeGL(self, width: int, height: int) -> None:
        """Start with a frame buffer of another size."""
        super().resizeGL(width, height)
        self.refresh()

    def paintGL(self) -> None:
        """Draw what is stale; the only place where anything is drawn."""
        if self._closed:
            return
        stale = [plot for plot in self._plots if plot.is_shown and plot.is_stale]
        for plot in self._plots:
            plot.renderer.SetDraw(plot in stale)
        if (box_mm := self.box_mm()) is not None:
            self.renderers[0].ResetCameraClippingRange(box_mm.ravel())
        if stale or box_mm is None:  # VTK makes its frame buffer when it draws first
            self.iren.interactor.EnableRenderOn()
        super().paintGL()
        self.iren.interactor.EnableRenderOff()
        for plot in stale:
            plot.is_stale = False
        self.drawn.emit(len(stale))

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Tell that the mouse holds the shapes."""
        super().mousePressEvent(event)
        self.held.emit(True)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """Tell that the mouse let go of the shapes."""
        super().mouseReleaseEvent(event)
        self.held.emit(False)

    def release(self) -> None:
        """Close the render window for good; nothing is drawn afterwards."""
        self.iren.interactor.RemoveObserver(self._requests)
        self.close()
        self._forget_context()  # Qt deletes context and surface; Python must not know them any longer
        self.deleteLater()

    def _render_requested(self, _interactor: object, _event: str) -> None:
        """The mouse moved the camera."""
        if not self._in_paint:
            self.refresh()

    def _sub_plot(self, index: int, colour: str) -> SubPlot:
        mesh = pv.PolyData()
        self.subplot(0, index)
        actor = self.add_actor(pv.Actor(mapper=pv.DataSetMapper(mesh)), render=False)[0]
        actor.prop.color, actor.prop.interpolation = colour, "Phong"
        actor.prop.point_size, actor.prop.render_points_as_spheres = POINT_PX, True
        plot = SubPlot(self.renderers[index], actor, mesh)
        plot.renderer.SetUseOIT(False)  # a ghost is one layer: nothing to sort, which would cost time
        _colour(plot, None)
        return plot


def _move(plot: SubPlot, old: SurfaceResult | None, result: SurfaceResult) -> None:
    """Replace the surface of a sub-plot, or only its vertices where it has the same triangles."""
    if old is not None and old.faces is result.faces and len(result.faces):
        plot.mesh.points[:] = result.points_mm
        plot.mesh.point_data.active_normals[:] = result.normals
    else:
        plot.mesh.copy_from(as_polydata(result), deep=False)
        plot.actor.prop.culling = "back" if is_closed(result.faces) else "none"


def _colour(plot: SubPlot, colouring: Colouring | None) -> None:
    """Colour the vertices of a sub-plot, or all of it in its own colour."""
    mapper = plot.actor.mapper
    mapper.scalar_visibility = colouring is not None
    for name, value in (SHINY if colouring is None else MATT).items():
        setattr(plot.actor.prop, name, value)
    if colouring is not None:
        plot.mesh.point_data.set_scalars(colouring.values_mm, "mm")
        mapper.lookup_table = look_up_table(colouring.limit_mm, colouring.is_signed)
        mapper.use_lookup_table_scalar_range = True
