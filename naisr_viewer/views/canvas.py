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

from naisr_viewer.requests import SurfaceResult

REST_SAMPLES = 4
"""Multi-sampling at rest; none while something moves, where it costs two thirds of a frame."""

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
    if len(result.faces) == 0:
        return pv.PolyData()
    mesh = pv.PolyData.from_regular_faces(result.points_mm.copy(), result.faces)
    mesh.point_data.active_normals = result.normals.copy()
    return mesh


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
        is_shown: whether it has a part of the canvas.
        is_stale: whether the canvas shows something else.
    """

    renderer: pv.Renderer
    actor: pv.Actor
    mesh: pv.PolyData
    result: SurfaceResult | None = None
    is_shown: bool = False
    is_stale: bool = True


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
        if old is not None and old.points_mm is result.points_mm and old.faces is result.faces:
            return
        if old is not None and old.faces is result.faces and len(result.faces):
            plot.mesh.points[:] = result.points_mm
            plot.mesh.point_data.active_normals[:] = result.normals
        else:
            plot.mesh.copy_from(as_polydata(result), deep=False)
            plot.actor.prop.culling = "back" if is_closed(result.faces) else "none"
        plot.is_stale = True
        self.update()

    def box_mm(self) -> NDArray[np.float64] | None:
        """Bounds of all surfaces that are shown, ``[3, 2]``; None where there are none."""
        boxes = [plot.mesh.bounds for plot in self._plots if plot.is_shown and plot.mesh.n_points]
        if not boxes:
            return None
        return np.stack([np.min(boxes, axis=0)[::2], np.max(boxes, axis=0)[1::2]], axis=1)

    def set_background(self, colour: str) -> None:
        """Colour what is behind the surfaces (``#rrggbb``)."""
        for renderer in self.renderers:
            renderer.set_background(colour)
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
        look = actor.prop
        look.color, look.interpolation = colour, "Phong"
        look.ambient, look.diffuse, look.specular, look.specular_power = 0.25, 0.9, 0.2, 25
        return SubPlot(self.renderers[index], actor, mesh)
