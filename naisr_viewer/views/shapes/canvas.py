"""What draws the sub-plots, loaded behind the window. The only user of pyvistaqt."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt, QTimer, Signal
from PySide6.QtGui import QMouseEvent, QWheelEvent
from PySide6.QtWidgets import QApplication, QWidget
from pyvistaqt import QtInteractor

from naisr_viewer.state.requests import SurfaceResult
from naisr_viewer.state.section import Cut, Section
from naisr_viewer.views.colours import PALENESS, blend
from naisr_viewer.views.shapes.arrangement import Viewport
from naisr_viewer.views.shapes.camera import (
    Direction,
    aim,
    centre_on,
    is_any_seen,
    pan,
    seen_size,
    turn,
    zoom_at,
)
from naisr_viewer.views.shapes.looks import INK, INKINESS, POINT_PX, as_ghost, as_marks, clip, make_cap
from naisr_viewer.views.shapes.sub_plot import SubPlot, picked, set_colouring, set_nothing, set_points

REST_SAMPLES = 4
"""Multi-sampling at rest; none while something moves, where it costs two thirds of a frame."""

HOVER_MS = 80
"""So long a mouse rests before it is looked what is under it: never while it is on its way."""

NOTCH, NOTCH_ZOOM = 120, 1.15
"""Of a wheel, in Qt's units; how much larger it shows everything."""

MOVED: dict[str, Any] = {
    f"{keys}{button}": "pan" for keys in ("", "shift_", "control_") for button in ("left", "middle")
}
"""What dragging does to curves in the plane."""

CLICK_PX = 4
"""A mouse that has gone so far between press and release has turned the shapes."""


class Canvas(QtInteractor):
    """A row of sub-plots that draws what changed, once per change, when Qt asks it to paint.

    VTK draws into a frame buffer of its own, which keeps the sub-plots that are not drawn again.

    Args:
        colours: one sub-plot, still empty and hidden, for each of these (``#rrggbb``).
        parent: the widget around it.
        is_flat: whether curves in the plane are shown: they are moved and never turned.
    """

    drawn = Signal(int)  # the picture is on its way to the screen; how many sub-plots were drawn anew
    clicked = Signal(int, object)  # a short click, no double one: which sub-plot, and the point (mm) there
    chosen = Signal(int)  # a short click on a sub-plot, beside its surface too
    opened = Signal(int)  # a double click on a sub-plot, after that
    hovered = Signal(int, object)  # the mouse rests: over which sub-plot, and the Hit there or None
    left = Signal()  # what was told of the mouse holds no more

    def __init__(self, colours: Sequence[str], parent: QWidget, is_flat: bool = False) -> None:
        self._is_flat = is_flat
        self._plots: list[SubPlot] = []
        self._ghost_colour, self._ground = "#000000", "#ffffff"
        self._is_moving = self._is_held = False
        self._pressed: QPoint | None = None
        self._place = QPointF()
        self._plane: pv._vtk.vtkPlane | None = None
        super().__init__(
            parent, shape=(1, len(colours)), border=False, auto_update=False, multi_samples=REST_SAMPLES
        )
        self.setAcceptDrops(False)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._rest = QTimer(self, singleShot=True, interval=HOVER_MS)
        self._rest.timeout.connect(self._look_under_mouse)
        self._single = QTimer(self, singleShot=True, interval=QApplication.doubleClickInterval())
        self._single.timeout.connect(self._tell_clicked)
        self._hit: tuple[int, Direction] | None = None
        self._requests = self.iren.interactor.AddObserver("RenderEvent", self._render_requested)
        self.iren.interactor.EnableRenderOff()
        self._plots = [self._sub_plot(index, colour) for index, colour in enumerate(colours)]
        self.link_views()
        self.enable_parallel_projection()
        if is_flat:
            self.enable_custom_trackball_style(**MOVED)

    def set_surface(self, index: int, result: SurfaceResult) -> None:
        """Show a surface; where only its vertices moved, nothing else is sent to OpenGL again."""
        plot = self._plots[index]
        old, plot.result = plot.result, result
        is_same = old is not None and old.points_mm is result.points_mm and old.faces is result.faces
        if old is not None and is_same and old.colouring is result.colouring:
            return
        if not is_same:
            set_points(plot, old, result)
        set_colouring(plot, result.colouring)
        plot.is_stale = True
        self._forget_hover()
        self.update()

    def clear_surface(self, index: int) -> None:
        """Show nothing until the next surface comes."""
        plot = self._plots[index]
        self._forget_hover()
        set_nothing(plot)
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
            clip(plot.ghost, self._plane)
            plot.renderer.add_actor(plot.ghost, render=False, reset_camera=False)
        plot.is_stale = True
        self.update()

    def set_section(self, section: Section | None) -> None:
        """Draw only what lies on one side of a plane; None draws all."""
        self._plane = None if section is None else _kept_half(section)
        for plot in self._plots:
            for actor in filter(None, (plot.actor, plot.ghost)):
                clip(actor, self._plane)
        self.refresh()

    def set_edges(self, has_edges: bool) -> None:
        """Draw the triangles of the surfaces, in a darker colour, or not."""
        for plot in self._plots:
            plot.actor.prop.show_edges = has_edges
        self.refresh()

    def set_cut(self, index: int, cut: Cut | None) -> None:
        """Fill what the plane cuts of a surface; None removes that."""
        plot = self._plots[index]
        if self._is_flat or (plot.cap is None and cut is None):
            return
        if plot.cap is None:
            plot.cap = make_cap()
            self._paint(plot)
            for actor in plot.cap:
                plot.renderer.add_actor(actor, render=False, reset_camera=False)
        plot.cap.show(cut)
        plot.is_stale = True
        self.update()

    def set_marks(self, index: int, points_mm: NDArray[np.float32], colours: Sequence[str]) -> None:
        """Mark places ``[n, 3]`` of a surface with dots of these colours (``#rrggbb``), and no others."""
        plot = self._plots[index]
        if plot.marks is None and not len(points_mm):
            return
        if plot.marks is not None:
            plot.renderer.remove_actor(plot.marks, render=False)
        plot.marks = as_marks(points_mm, colours) if len(points_mm) else None
        if plot.marks is not None:
            plot.renderer.add_actor(plot.marks, render=False, reset_camera=False)
        plot.is_stale = True
        self.update()

    def set_colour(self, index: int, colour: str, is_pale: bool) -> None:
        """Colour a surface whose vertices have no colours (``#rrggbb``), much like the ground where pale."""
        plot = self._plots[index]
        if (plot.colour, plot.is_pale) != (colour, is_pale):
            plot.colour, plot.is_pale = colour, is_pale
            self._paint(plot)
            self.update()

    def box_mm(self) -> NDArray[np.float64] | None:
        """Bounds of all that is shown, ``[3, 2]``; None where there is nothing."""
        boxes = [box for plot in self._plots if plot.is_shown for box in plot.boxes]
        if not boxes:
            return None
        return np.stack([np.min(boxes, axis=0)[::2], np.max(boxes, axis=0)[1::2]], axis=1)

    def set_colours(self, background: str, ghost: str) -> None:
        """Colour what is behind the surfaces and what lies over them (``#rrggbb``)."""
        self._ghost_colour, self._ground = ghost, background
        for plot in self._plots:
            self._paint(plot)
            plot.renderer.set_background(background)
            if plot.ghost is not None:
                plot.ghost.prop.color = ghost
        self.refresh()

    def is_any_missed(self) -> bool:
        """Whether nothing is seen of the surface of a sub-plot."""
        shown = [plot for plot in self._plots if plot.is_shown and plot.mesh.n_points]
        return any(not is_any_seen(self.camera, plot.mesh.points, self._aspect(plot)) for plot in shown)

    def set_eye_level(self, share: float) -> None:
        """Draw what the camera looks at above the middle of each sub-plot, by a share of half its height."""
        self.camera.SetWindowCenter(0.0, -share)

    def set_viewports(self, viewports: Sequence[Viewport | None]) -> None:
        """Say where each sub-plot is; None hides it."""
        for plot, viewport in zip(self._plots, viewports, strict=True):
            plot.is_shown = viewport is not None
            plot.renderer.SetInteractive(plot.is_shown)
            if viewport is not None:
                plot.renderer.SetViewport(*viewport)
        self.refresh()

    def set_moving(self, moving: bool) -> None:
        """Draw quickly while the surfaces move, smoothly at rest."""
        self._is_moving = moving
        self._choose_quality()

    def look(self, direction: Direction, up: Direction) -> None:
        """Stand in this direction from the middle."""
        self.camera.focal_point, self.camera.position, self.camera.up = (0, 0, 0), direction, up
        self.refresh()

    def frame(self, box_mm: NDArray[np.float64]) -> tuple[float, float]:
        """Look at the middle of ``box_mm`` ``[3, 2]``; returns its width and height as seen (mm)."""
        aim(self.camera, box_mm)
        self.refresh()
        return seen_size(self.camera, box_mm)

    def turn(self, azimuth_deg: float, elevation_deg: float) -> None:
        """Go around the shapes, to the right and up."""
        turn(self.camera, azimuth_deg, elevation_deg)
        self.refresh()

    def pan(self, across: float, along: float) -> None:
        """Have the shapes go to the right and up by shares of half the height of a sub-plot."""
        pan(self.camera, across, along)
        self.refresh()

    def zoom_by(self, factor: float) -> None:
        """Come nearer by a factor."""
        self.camera.parallel_scale /= factor
        self.refresh()

    def refresh(self) -> None:
        """Draw everything again with the next painting."""
        for plot in self._plots:
            plot.is_stale = True
        self.update()

    def devicePixelRatioF(self) -> float:
        """Pixels of the screen per pixel of Qt, a trace more than that.

        Qt rounds half a pixel up, Python to the even one: without the trace VTK would leave a line undrawn.
        """
        return super().devicePixelRatioF() + 1e-9

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
        """Draw quickly while the mouse holds the shapes."""
        super().mousePressEvent(event)
        self._pressed = event.position().toPoint() if event.button() is Qt.MouseButton.LeftButton else None
        self._set_held(True)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Turn the shapes, or come to rest over one."""
        super().mouseMoveEvent(event)
        self._forget_hover()
        if event.buttons() == Qt.MouseButton.NoButton and not self._is_moving:
            self._place = event.position()
            self._rest.start()

    def leaveEvent(self, event: QEvent) -> None:
        """Nothing is under the mouse any more."""
        super().leaveEvent(event)
        self._forget_hover()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """Draw smoothly again when the mouse lets go of the shapes."""
        super().mouseReleaseEvent(event)
        self._set_held(False)
        place, pressed, self._pressed = event.position(), self._pressed, None
        if pressed is not None and (place.toPoint() - pressed).manhattanLength() < CLICK_PX:
            self._pick(place)

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        """Tell it, and have the point there in the middle; it was no click, and what follows is none."""
        super().mouseDoubleClickEvent(event)
        self._single.stop()
        self._pressed = None
        if event.button() is Qt.MouseButton.LeftButton:
            for index, plot in self._plots_at(event.position()):
                hit = picked(plot, *self._from_below(event.position()))
                if hit is not None:
                    centre_on(self.camera, hit.point_mm)
                    self.refresh()
                self.opened.emit(index)

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Come nearer to what is under the pointer, or go away from it."""
        factor = NOTCH_ZOOM ** (event.angleDelta().y() / NOTCH)
        for _, plot in self._plots_at(event.position()):
            zoom_at(self.camera, factor, self._place_in(plot, event.position()), self._aspect(plot))
            self.refresh()
        event.accept()

    def release(self) -> None:
        """Close the render window for good; nothing is drawn afterwards."""
        for waiting in (self._rest, self._single):
            waiting.stop()
        self.iren.interactor.RemoveObserver(self._requests)
        self.close()
        self._forget_context()  # Qt deletes context and surface; Python must not know them any longer
        self.deleteLater()

    def _pick(self, place: QPointF) -> None:
        """Tell what was clicked."""
        for index, plot in self._plots_at(place):
            hit = picked(plot, *self._from_below(place))
            if hit is not None:
                self._hit = index, hit.point_mm
                self._single.start()
            self.chosen.emit(index)

    def _tell_clicked(self) -> None:
        """It has not become a double click."""
        if self._hit is not None:
            self.clicked.emit(*self._hit)

    def _look_under_mouse(self) -> None:
        for index, plot in self._plots_at(self._place):
            self.hovered.emit(index, picked(plot, *self._from_below(self._place)))

    def _forget_hover(self) -> None:
        self._rest.stop()
        self.left.emit()

    def _plots_at(self, place: QPointF) -> list[tuple[int, SubPlot]]:
        """The sub-plot there, with its number, if any."""
        x, y = self._from_below(place)
        return [
            (index, plot)
            for index, plot in enumerate(self._plots)
            if plot.is_shown and plot.renderer.IsInViewport(round(x), round(y))
        ]

    def _place_in(self, plot: SubPlot, place: QPointF) -> tuple[float, float]:
        """A place on the canvas to the right and up of the middle of a sub-plot, 1 at its edges."""
        left, bottom, right, top = plot.renderer.GetViewport()
        x, y = place.x() / self.width(), 1 - place.y() / self.height()
        return (2 * x - left - right) / (right - left), (2 * y - bottom - top) / (top - bottom)

    def _from_below(self, place: QPointF) -> tuple[float, float]:
        """A place on the canvas in pixels of the screen, counted from below as VTK does."""
        ratio = self.devicePixelRatioF()
        return place.x() * ratio, (self.height() - 1 - place.y()) * ratio

    def _paint(self, plot: SubPlot) -> None:
        """In the colour of a sub-plot."""
        colour = blend(plot.colour, self._ground, PALENESS if plot.is_pale else 0.0)
        plot.actor.prop.color, plot.actor.prop.edge_color = colour, blend(colour, INK, INKINESS)
        if plot.cap is not None:
            plot.cap.colour(colour)
        plot.is_stale = True

    def _aspect(self, plot: SubPlot) -> float:
        """Width over height of a sub-plot."""
        left, bottom, right, top = plot.renderer.GetViewport()
        return float((right - left) * self.width() / max((top - bottom) * self.height(), 1.0))

    def _set_held(self, held: bool) -> None:
        self._is_held = held
        self._choose_quality()

    def _choose_quality(self) -> None:
        samples = 0 if self._is_moving or self._is_held else REST_SAMPLES
        if self.ren_win.GetMultiSamples() != samples:
            self.ren_win.SetMultiSamples(samples)
            self.refresh()

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
        plot = SubPlot(self.renderers[index], actor, mesh, colour)
        plot.renderer.SetUseOIT(False)  # a ghost is one layer: nothing to sort, which would cost time
        set_colouring(plot, None)
        if self._is_flat:
            plot.cap = make_cap(actor)
            plot.renderer.add_actor(plot.cap.filled, render=False, reset_camera=False)
        return plot


def _kept_half(section: Section) -> pv._vtk.vtkPlane:
    """The plane, its normal towards what is drawn."""
    plane, normal = pv._vtk.vtkPlane(), np.asarray(section.normal)
    plane.SetOrigin(*(normal * section.offset_mm))
    plane.SetNormal(*(normal if section.is_low_cut else -normal))
    return plane
