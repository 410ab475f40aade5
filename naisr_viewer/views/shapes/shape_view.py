"""The centre: linked sub-plots that share one camera, drawn by a canvas and labelled by Qt."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from threading import Thread
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QRect, Qt, Signal
from PySide6.QtGui import QResizeEvent, QSurfaceFormat
from PySide6.QtOpenGLWidgets import QOpenGLWidget
from PySide6.QtWidgets import QFrame, QLabel, QVBoxLayout, QWidget

from naisr_viewer.state.explorer import FULL_SHAPE, OF_A_PATIENT, AtlasCard, Panel, all_panels
from naisr_viewer.state.requests import SurfaceResult
from naisr_viewer.views.colours import ghost_colour, panel_colour
from naisr_viewer.views.shapes.cell import TITLE_PX, Cell, drawn_height, make_cell, strip_height
from naisr_viewer.views.shapes.grid import cells, columns_for, separators
from naisr_viewer.views.theme import LIGHT, Theme

if TYPE_CHECKING:
    from naisr_viewer.views.shapes.canvas import Canvas, Viewport

ROOM = 1.25
"""A shape is framed with this much room, so that it can grow while a slider moves."""

OF_PATIENTS = tuple(
    dict.fromkeys(panel for shown in OF_A_PATIENT.values() for panel in shown if panel != FULL_SHAPE)
)
"""Sub-plots besides those that every atlas has."""

NO_FACES = np.zeros((0, 3), np.int64)

DRAWING = "naisr_viewer.views.shapes.canvas"
"""The module that draws; loaded behind the window, because VTK takes a while."""

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


class ShapeView(QWidget):
    """Template, effects, full shape and the sub-plots of patients, seen through one camera."""

    scale_changed = Signal(float)  # pixels per millimetre, after zooming or resizing
    drawn = Signal(int)  # the picture is on its way to the screen; how many sub-plots were drawn anew

    _drawing_loaded = Signal()  # from the thread that imports: the drawing library has arrived

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("canvasArea")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        # A window of its own: Qt puts everything in a window with an OpenGL widget together by OpenGL, and
        # a moving slider beside it would have all of it put together once more.
        self.setAttribute(Qt.WidgetAttribute.WA_DontCreateNativeAncestors)
        self.setAttribute(Qt.WidgetAttribute.WA_NativeWindow)
        self._reserve_opengl()
        self._canvas: Canvas | None = None
        self._make_canvas: type[Canvas] | None = None
        self._loading: Thread | None = None
        self._theme = LIGHT
        self._atlas: AtlasCard | None = None
        self._cells: dict[Panel, Cell] = {}
        self._visible: tuple[Panel, ...] = ()
        self._separators: list[QFrame] = []
        self._ghost: tuple[NDArray[np.float32] | None, NDArray[np.int64]] = (None, NO_FACES)
        self._direction = OBLIQUE
        self._framed = False
        self._moving = self._held = False
        self._seen_mm = (1.0, 1.5)
        self._fit_scale = 1.0
        self._strip = 0
        self._drawn_height = 1
        self._pixels_per_mm = 0.0
        self._area = QVBoxLayout(self)
        self._area.setContentsMargins(0, 0, 0, 0)
        self._drawing_loaded.connect(self._start_drawing, Qt.ConnectionType.QueuedConnection)

    @property
    def is_ready(self) -> bool:
        """Whether surfaces are drawn as soon as they are shown."""
        return self._make_canvas is not None

    def prepare(self) -> None:
        """Load what draws the shapes, beside the window where that takes time."""
        if self._make_canvas is not None or self._loading is not None:
            return
        if DRAWING in sys.modules:
            self._start_drawing()
        else:
            self._loading = Thread(target=self._load, name="naisr-drawing", daemon=True)
            self._loading.start()

    def show_atlas(self, atlas: AtlasCard, theme: Theme) -> None:
        """Make one sub-plot per panel of ``atlas`` and of its patients, still without surfaces."""
        self.prepare()
        self._remove_cells()
        self._atlas = atlas
        self._cells = {panel: make_cell(panel, atlas, self) for panel in (*all_panels(atlas), *OF_PATIENTS)}
        self._ghost = (None, NO_FACES)
        self._direction = OBLIQUE
        self._theme = theme
        self._open_canvas()

    def show_panels(self, panels: Sequence[Panel]) -> None:
        """Put these sub-plots on screen and hide the others."""
        if tuple(panels) != self._visible:
            self._visible = tuple(panels)
            self._arrange()

    def show_surface(self, result: SurfaceResult) -> None:
        """Replace one surface in place; all that are replaced before Qt paints again share one painting."""
        cell = self._cells[result.request.panel]
        cell.result = result
        if cell.bar is not None and result.colouring is not None:
            cell.bar.set_limit(result.colouring.limit_mm)
        if self._canvas is not None:
            self._canvas.set_surface(self._index(result.request.panel), result)
            self._frame_once(self._canvas)

    def clear_surface(self, panel: Panel) -> None:
        """Show nothing until the next surface comes."""
        cell = self._cells.get(panel)
        if cell is None:
            return
        cell.result = None
        self.set_caption(panel, "", "")
        if self._canvas is not None:
            self._canvas.clear_surface(self._index(panel))

    def show_ghost(self, points_mm: NDArray[np.float32] | None, faces: NDArray[np.int64] = NO_FACES) -> None:
        """Lay a scan over the full shape, translucent; without faces as dots.

        Args:
            points_mm: vertices, ``[n, 3]``; None takes the scan away.
            faces: vertex numbers of the triangles, ``[m, 3]``; none for a cloud of points.
        """
        if points_mm is self._ghost[0] and faces is self._ghost[1]:
            return
        self._ghost = (points_mm, faces)
        if self._canvas is not None:
            self._canvas.set_ghost(self._index(FULL_SHAPE), *self._ghost)

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
        self._moving = moving
        self._choose_quality()

    def set_theme(self, theme: Theme) -> None:
        """Follow the theme."""
        self._theme = theme
        if self._canvas is not None:
            self._canvas.set_colours(theme.canvas, ghost_colour(theme))

    def reset_camera(self) -> None:
        """Frame what is on screen, keeping the direction."""
        box_mm = None if self._canvas is None else self._canvas.box_mm()
        if self._canvas is None or box_mm is None:
            return
        self._seen_mm = self._canvas.frame(box_mm)
        self._arrange()
        self._canvas.camera.parallel_scale = self._fit_scale

    def look_from(self, direction: str) -> None:
        """Stand at one of :data:`DIRECTIONS` and frame what is on screen."""
        self._direction = DIRECTIONS[direction]
        if self._canvas is not None:
            self._canvas.look(*self._direction)
            self.reset_camera()

    def clear(self) -> None:
        """Release the render window and all labels; nothing is drawn afterwards."""
        self._remove_cells()
        if self._loading is not None:
            self._loading.join()
        self._drawing_loaded.disconnect(self._start_drawing)
        self._close_canvas()
        self._make_canvas = self._atlas = None  # what was loaded may still be on its way here

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Rearrange for the new size."""
        super().resizeEvent(event)
        self._arrange()

    def _reserve_opengl(self) -> None:
        """Have the window made for OpenGL; else Qt makes it anew, visibly, when the canvas is added."""
        wanted = QSurfaceFormat()
        wanted.setRenderableType(QSurfaceFormat.RenderableType.OpenGL)
        wanted.setProfile(QSurfaceFormat.OpenGLContextProfile.CoreProfile)
        wanted.setVersion(3, 2)  # the least that VTK draws with
        wanted.setAlphaBufferSize(8)
        QSurfaceFormat.setDefaultFormat(wanted)
        QOpenGLWidget(self).hide()

    def _load(self) -> None:
        """In a thread of its own; an error is met again, and told, when the canvas is opened."""
        with suppress(ImportError):
            import_module(DRAWING)
        self._drawing_loaded.emit()

    def _start_drawing(self) -> None:
        self._make_canvas = import_module(DRAWING).Canvas
        self._open_canvas()

    def _open_canvas(self) -> None:
        """Start drawing anew, with all that was shown before."""
        self._close_canvas()
        if self._make_canvas is None or self._atlas is None:
            return
        colours = [panel_colour(self._atlas, panel) for panel in self._cells]
        self._canvas = self._make_canvas(colours, self)
        self._canvas.drawn.connect(self._tell_drawn)
        self._canvas.held.connect(self._set_held)
        self._area.addWidget(self._canvas)
        self._canvas.show()  # the layout would only do so with the next turn of the event loop
        self._canvas.look(*self._direction)
        self._framed, self._held = False, False
        self.set_theme(self._theme)
        self._choose_quality()
        for index, cell in enumerate(self._cells.values()):
            if cell.result is not None:
                self._canvas.set_surface(index, cell.result)
        self._canvas.set_ghost(self._index(FULL_SHAPE), *self._ghost)
        self._arrange()
        self._frame_once(self._canvas)

    def _close_canvas(self) -> None:
        if self._canvas is not None:
            self._area.removeWidget(self._canvas)
            self._canvas.release()
            self._canvas = None

    def _frame_once(self, canvas: Canvas) -> None:
        """Frame the first surfaces; afterwards the camera is the user's."""
        if not self._framed and canvas.box_mm() is not None:
            self.reset_camera()
            self._framed = all(self._cells[panel].has_surface for panel in self._visible)

    def _choose_quality(self) -> None:
        if self._canvas is not None:
            self._canvas.set_smooth(not self._moving and not self._held)

    def _set_held(self, held: bool) -> None:
        self._held = held
        self._choose_quality()

    def _remove_cells(self) -> None:
        for cell in self._cells.values():
            for widget in cell.widgets:
                widget.deleteLater()
        for line in self._separators:
            line.deleteLater()
        self._cells, self._separators, self._visible = {}, [], ()

    def _index(self, panel: Panel) -> int:
        """Which of the canvas's sub-plots a panel has."""
        return list(self._cells).index(panel)

    def _arrange(self) -> None:
        """Divide the canvas among the visible panels, keeping the user's zoom."""
        if not self._visible or not self.width() or not self.height():
            return
        wide, high = self._seen_mm
        columns = columns_for(len(self._visible), self.width() / self.height(), wide / high)
        places = map(self._pixels, cells(len(self._visible), columns))
        areas = dict(zip(self._visible, places, strict=True))
        first = areas[self._visible[0]]
        self._strip = strip_height(self._visible)
        self._drawn_height = drawn_height(first, self._strip)
        old_fit, self._fit_scale = self._fit_scale, self._scale_to_fit(first, wide, high)
        if self._canvas is not None:
            self._canvas.camera.parallel_scale *= self._fit_scale / old_fit
            self._canvas.set_viewports(
                [self._viewport(areas[panel]) if panel in areas else None for panel in self._cells]
            )
        self._place_labels(areas)
        self._place_separators(areas)

    def _tell_drawn(self, count: int) -> None:
        if self._canvas is not None and self._framed:
            scale = self._drawn_height / (2 * self._canvas.camera.parallel_scale)
            if scale != self._pixels_per_mm:
                self._pixels_per_mm = scale
                self.scale_changed.emit(scale)
        self.drawn.emit(count)

    def _scale_to_fit(self, area: QRect, wide: float, high: float) -> float:
        """Millimetres from the middle to the top of a sub-plot in which the framed box fits."""
        height = drawn_height(area, self._strip)
        return ROOM * max(high, wide * height / area.width()) / 2

    def _viewport(self, area: QRect) -> Viewport:
        """Where the shape is drawn inside ``area``, between its title and its caption."""
        top = area.top() + TITLE_PX
        bottom = top + drawn_height(area, self._strip)
        left, right = area.left() / self.width(), (area.left() + area.width()) / self.width()
        return left, 1 - bottom / self.height(), right, 1 - top / self.height()

    def _pixels(self, place: tuple[float, float, float, float]) -> QRect:
        left, top = round(place[0] * self.width()), round(place[1] * self.height())
        right, bottom = (place[0] + place[2]) * self.width(), (place[1] + place[3]) * self.height()
        return QRect(left, top, round(right) - left, round(bottom) - top)

    def _place_labels(self, areas: dict[Panel, QRect]) -> None:
        for panel, cell in self._cells.items():
            if panel in areas:
                cell.place(areas[panel], self._strip)
            for widget in cell.widgets:
                widget.setVisible(panel in areas)
                widget.raise_()

    def _place_separators(self, areas: dict[Panel, QRect]) -> None:
        for line in self._separators:
            line.hide()  # deleted later; it would be seen until then
            line.deleteLater()
        self._separators = []
        for edge in separators(list(areas.values())):
            line = QFrame(self)
            line.setObjectName("separator")
            line.setGeometry(*edge)
            line.show()
            self._separators.append(line)
