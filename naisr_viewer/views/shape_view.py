"""The centre: linked sub-plots that share one camera. The only user of pyvistaqt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from PySide6.QtCore import QRect, Qt, Signal
from PySide6.QtGui import QImage, QResizeEvent
from PySide6.QtWidgets import QFrame, QLabel, QVBoxLayout, QWidget
from pyvistaqt import QtInteractor

from naisr_viewer.requests import SurfaceResult
from naisr_viewer.state import AtlasCard, Panel, all_panels, panel_title
from naisr_viewer.views.theme import Theme, panel_colour

ROOM = 1.25
"""A shape is framed with this much room, so that it can grow while a slider moves."""

TITLE_PX = 36
CAPTION_PX = 52
"""Strips above and beneath each shape, kept free for words."""

REST_SAMPLES = 4
"""Multi-sampling at rest; none while dragging, where it costs two thirds of a frame."""

HINTS = {
    "template": "The shape from which all others are made.",
    "effect": (
        "The template moved by this covariate alone, all others at the population mean.\n"
        "Displacements add up at a point; the surfaces shown here do not add up to the full shape."
    ),
    "shape": "The template moved by all covariates together.",
}

DIRECTIONS: dict[str, tuple[tuple[float, float, float], tuple[float, float, float]]] = {
    "the front": ((0, -1, 0), (0, 0, 1)),
    "the back": ((0, 1, 0), (0, 0, 1)),
    "the left": ((1, 0, 0), (0, 0, 1)),
    "the right": ((-1, 0, 0), (0, 0, 1)),
    "above": ((0, 0, 1), (0, -1, 0)),
    "below": ((0, 0, -1), (0, -1, 0)),
}
"""Side of the body the camera stands at, and which way is up; x points left, y back, z up."""

OBLIQUE = ((0.9, -0.45, 0.15), (0.0, 0.0, 1.0))
"""The view an atlas opens with: from the left and a little from the front."""


def columns_for(count: int, canvas_aspect: float, shape_aspect: float) -> int:
    """Columns of a grid of ``count`` panels in which a shape is drawn largest.

    Args:
        count: how many panels.
        canvas_aspect: width over height of the whole canvas.
        shape_aspect: width over height of a shape as seen.
    """

    def drawn_height(columns: int) -> float:
        rows = -(-count // columns)
        return min(1 / rows, canvas_aspect / columns / shape_aspect)

    return max(range(1, count + 1), key=lambda columns: (round(drawn_height(columns), 6), -columns))


def cells(count: int, columns: int) -> list[tuple[float, float, float, float]]:
    """Left, top, width and height of each panel as shares of the canvas; the last fills its row."""
    rows = -(-count // columns)
    width, height = 1 / columns, 1 / rows
    places = [((i % columns) * width, (i // columns) * height, width, height) for i in range(count)]
    left, top, _, _ = places[-1]
    return [*places[:-1], (left, top, 1 - left, height)]


def drawn_height(area: QRect) -> int:
    """Pixels left for the shape between the title and the caption of a sub-plot."""
    return max(area.height() - TITLE_PX - CAPTION_PX, 1)


def as_polydata(result: SurfaceResult) -> pv.PolyData:
    """The surface with its normals."""
    if len(result.faces) == 0:
        return pv.PolyData()
    mesh = pv.PolyData.from_regular_faces(result.points_mm, result.faces)
    mesh.point_data.active_normals = result.normals
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


class Canvas(QtInteractor):
    """An interactor that draws once per change, when Qt asks it to paint."""

    def __init__(self, panels: int, parent: QWidget) -> None:
        super().__init__(
            parent, shape=(1, panels), border=False, auto_update=False, multi_samples=REST_SAMPLES
        )
        self.setAcceptDrops(False)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.bounds_mm: tuple[float, ...] | None = None
        self._requests = self.iren.interactor.AddObserver("RenderEvent", self._render_requested)
        self.iren.interactor.EnableRenderOff()

    drawn = Signal()  # the scene has just been drawn

    def paintGL(self) -> None:
        """Draw; the only place where anything is drawn."""
        if self._closed:
            return
        if self.bounds_mm is not None:
            self.renderers[0].ResetCameraClippingRange(self.bounds_mm)
        self.iren.interactor.EnableRenderOn()
        super().paintGL()
        self.iren.interactor.EnableRenderOff()
        self.drawn.emit()

    def release(self) -> None:
        """Close the render window for good; nothing is drawn afterwards."""
        self.iren.interactor.RemoveObserver(self._requests)
        self.close()
        self.deleteLater()

    def _render_requested(self, _interactor: object, _event: str) -> None:
        if not self._in_paint:
            self.update()


@dataclass(eq=False)
class Cell:
    """One sub-plot on screen.

    Attributes:
        panel: what it shows.
        mesh: the drawn surface; its contents are replaced in place.
        title: the label above.
        volume: the label beneath.
    """

    panel: Panel
    mesh: pv.PolyData
    title: QLabel
    volume: QLabel


class ShapeView(QWidget):
    """Template, effects and full shape, seen through one camera."""

    scale_changed = Signal(float)  # pixels per millimetre, after zooming or resizing

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("canvasArea")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self._canvas: Canvas | None = None
        self._cells: dict[Panel, Cell] = {}
        self._visible: tuple[Panel, ...] = ()
        self._separators: list[QFrame] = []
        self._framed = False
        self._seen_mm = (1.0, 1.5)
        self._fit_scale = 1.0
        self._drawn_height = 1
        self._pixels_per_mm = 0.0
        self._area = QVBoxLayout(self)
        self._area.setContentsMargins(0, 0, 0, 0)

    def show_atlas(self, atlas: AtlasCard, theme: Theme) -> None:
        """Make one sub-plot per panel of ``atlas``, still without surfaces."""
        self.clear()
        panels = all_panels(atlas)
        self._canvas = Canvas(len(panels), self)
        self._canvas.drawn.connect(self._tell_scale)
        self._area.addWidget(self._canvas)
        self._cells = {
            panel: self._make_cell(index, panel, panel_colour(atlas, panel))
            for index, panel in enumerate(panels)
        }
        self._canvas.link_views()
        self._canvas.enable_parallel_projection()
        self._look(*OBLIQUE)
        self._framed = False
        self.set_theme(theme)

    def show_panels(self, panels: Sequence[Panel]) -> None:
        """Put these sub-plots on screen and hide the others."""
        if tuple(panels) != self._visible:
            self._visible = tuple(panels)
            self._arrange()

    def show_surface(self, result: SurfaceResult) -> None:
        """Replace one surface in place."""
        cell = self._cells[result.request.panel]
        cell.mesh.copy_from(as_polydata(result), deep=False)
        if self._canvas is not None:
            self._canvas.bounds_mm = self._bounds()
            if not self._framed:
                self.reset_camera()
                self._framed = all(self._cells[panel].mesh.n_points for panel in self._visible)
            self._canvas.update()

    def set_caption(self, panel: Panel, text: str, hint: str) -> None:
        """The line beneath a sub-plot, and more about it on hover."""
        self._cells[panel].volume.setText(text)
        self._cells[panel].volume.setToolTip(hint)

    def caption(self, panel: Panel) -> str:
        """The line beneath a sub-plot."""
        return self._cells[panel].volume.text()

    def title(self, panel: Panel) -> QLabel:
        """The label above a sub-plot."""
        return self._cells[panel].title

    def set_moving(self, moving: bool) -> None:
        """Draw quickly while a slider moves, smoothly at rest."""
        if self._canvas is None:
            return
        samples = 0 if moving else REST_SAMPLES
        if self._canvas.ren_win.GetMultiSamples() != samples:
            self._canvas.ren_win.SetMultiSamples(samples)
            self._canvas.update()

    def set_theme(self, theme: Theme) -> None:
        """Follow the theme."""
        if self._canvas is not None:
            for renderer in self._canvas.renderers:
                renderer.set_background(theme.canvas)
            self._canvas.update()

    def reset_camera(self) -> None:
        """Frame what is on screen, keeping the direction."""
        bounds_mm = self._bounds()
        if self._canvas is None or bounds_mm is None:
            return
        box = np.reshape(bounds_mm, (3, 2))
        aim(self._canvas.camera, box)
        self._seen_mm = seen_size(self._canvas.camera, box)
        self._arrange()
        self._canvas.camera.parallel_scale = self._fit_scale
        self._canvas.update()

    def look_from(self, direction: str) -> None:
        """Stand at one of :data:`DIRECTIONS` and frame what is on screen."""
        if self._canvas is not None:
            self._look(*DIRECTIONS[direction])
            self.reset_camera()

    def grab_image(self) -> QImage:
        """The sub-plots with their labels, as on screen."""
        return self.grab().toImage()

    def clear(self) -> None:
        """Release the render window and all labels."""
        for cell in self._cells.values():
            cell.title.deleteLater()
            cell.volume.deleteLater()
        for line in self._separators:
            line.deleteLater()
        self._cells, self._separators, self._visible = {}, [], ()
        if self._canvas is not None:
            self._area.removeWidget(self._canvas)
            self._canvas.release()
            self._canvas = None

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Rearrange for the new size."""
        super().resizeEvent(event)
        self._arrange()

    def _make_cell(self, index: int, panel: Panel, colour: str) -> Cell:
        assert self._canvas is not None
        mesh = pv.PolyData()
        self._canvas.subplot(0, index)
        actor = self._canvas.add_actor(pv.Actor(mapper=pv.DataSetMapper(mesh)), render=False)[0]
        prop = actor.prop
        prop.color, prop.interpolation = colour, "Phong"
        prop.ambient, prop.diffuse, prop.specular, prop.specular_power = 0.25, 0.9, 0.2, 25
        title = QLabel(f'<span style="color:{colour}">●</span>&nbsp;{panel_title(panel)}', self)
        title.setObjectName("panelTitle")
        title.setToolTip(HINTS[panel.kind])
        title.setWhatsThis(HINTS[panel.kind])
        volume = QLabel(self)
        volume.setObjectName("volume")
        volume.setAlignment(Qt.AlignmentFlag.AlignHCenter | Qt.AlignmentFlag.AlignTop)
        return Cell(panel, mesh, title, volume)

    def _bounds(self) -> tuple[float, ...] | None:
        """Bounds of all visible surfaces in millimetres."""
        boxes = [self._cells[p].mesh.bounds for p in self._visible if self._cells[p].mesh.n_points]
        if not boxes:
            return None
        lower, upper = np.min(boxes, axis=0)[::2], np.max(boxes, axis=0)[1::2]
        return tuple(map(float, np.stack([lower, upper], axis=1).ravel()))

    def _look(self, direction: tuple[float, float, float], up: tuple[float, float, float]) -> None:
        assert self._canvas is not None
        camera = self._canvas.camera
        camera.focal_point, camera.position, camera.up = (0, 0, 0), direction, up

    def _arrange(self) -> None:
        """Divide the canvas among the visible panels, keeping the user's zoom."""
        if self._canvas is None or not self._visible or not self.width() or not self.height():
            return
        wide, high = self._seen_mm
        columns = columns_for(len(self._visible), self.width() / self.height(), wide / high)
        places = map(self._pixels, cells(len(self._visible), columns))
        areas = dict(zip(self._visible, places, strict=True))
        for panel, renderer in zip(self._cells, self._canvas.renderers, strict=True):
            renderer.SetDraw(panel in areas)
            renderer.SetInteractive(panel in areas)
            if panel in areas:
                self._set_viewport(renderer, areas[panel])
        zoom = self._canvas.camera.parallel_scale / self._fit_scale
        self._drawn_height = drawn_height(areas[self._visible[0]])
        self._fit_scale = self._scale_to_fit(areas[self._visible[0]], wide, high)
        self._canvas.camera.parallel_scale = zoom * self._fit_scale
        self._place_labels(areas)
        self._place_separators(areas)
        self._canvas.update()

    def _tell_scale(self) -> None:
        if self._canvas is None or not self._framed:
            return
        scale = self._drawn_height / (2 * self._canvas.camera.parallel_scale)
        if scale != self._pixels_per_mm:
            self._pixels_per_mm = scale
            self.scale_changed.emit(scale)

    def _scale_to_fit(self, area: QRect, wide: float, high: float) -> float:
        """Millimetres from the middle to the top of a sub-plot in which the framed box fits."""
        height = drawn_height(area)
        return ROOM * max(high, wide * height / area.width()) / 2

    def _set_viewport(self, renderer: pv.Renderer, area: QRect) -> None:
        """Draw inside ``area``, between its title and its caption."""
        top = area.top() + TITLE_PX
        bottom = top + drawn_height(area)
        left, right = area.left() / self.width(), (area.left() + area.width()) / self.width()
        renderer.SetViewport(left, 1 - bottom / self.height(), right, 1 - top / self.height())

    def _pixels(self, place: tuple[float, float, float, float]) -> QRect:
        left, top = round(place[0] * self.width()), round(place[1] * self.height())
        right, bottom = (place[0] + place[2]) * self.width(), (place[1] + place[3]) * self.height()
        return QRect(left, top, round(right) - left, round(bottom) - top)

    def _place_labels(self, areas: dict[Panel, QRect]) -> None:
        for panel, cell in self._cells.items():
            cell.title.setVisible(panel in areas)
            cell.volume.setVisible(panel in areas)
            if panel in areas:
                area = areas[panel]
                cell.title.setGeometry(area.left(), area.top(), area.width(), TITLE_PX)
                bottom = area.top() + area.height()
                cell.volume.setGeometry(area.left(), bottom - CAPTION_PX, area.width(), CAPTION_PX)
                cell.title.raise_()
                cell.volume.raise_()

    def _place_separators(self, areas: dict[Panel, QRect]) -> None:
        for line in self._separators:
            line.deleteLater()
        edges = {QRect(r.left(), r.top(), 1, r.height()) for r in areas.values() if r.left() > 0}
        edges |= {QRect(r.left(), r.top(), r.width(), 1) for r in areas.values() if r.top() > 0}
        self._separators = []
        for edge in edges:
            line = QFrame(self)
            line.setObjectName("separator")
            line.setGeometry(edge)
            line.show()
            self._separators.append(line)
