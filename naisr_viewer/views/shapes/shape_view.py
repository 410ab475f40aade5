"""The centre: linked sub-plots that share one camera, drawn by a canvas and labelled by Qt."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QMargins, QSize, Qt, Signal, SignalInstance
from PySide6.QtGui import QFocusEvent, QKeyEvent, QMouseEvent, QResizeEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QWidget

from naisr_viewer.panels.kinds import all_panels
from naisr_viewer.panels.scales import PanelScale
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.camera import Camera
from naisr_viewer.state.layouts import FULL_SHAPE, Panel
from naisr_viewer.state.requests import SurfaceResult
from naisr_viewer.state.section import Cut, Section
from naisr_viewer.views.colours import ghost_colour, panel_colour
from naisr_viewer.views.shapes.arrangement import (
    Rows,
    Strips,
    areas_for,
    eye_level,
    rows_for,
    rows_of,
    scale_to_fit,
    viewport,
)
from naisr_viewer.views.shapes.camera import DIRECTIONS, FLAT, OBLIQUE, Direction, axes_of
from naisr_viewer.views.shapes.cell import columns_of, strips_of
from naisr_viewer.views.shapes.drawing import Drawing, reserve_opengl
from naisr_viewer.views.shapes.grid import Grid
from naisr_viewer.views.shapes.heads import MARGINS, HeadBands
from naisr_viewer.views.shapes.row_scroll import row_scroll, show_rows
from naisr_viewer.views.theme import LIGHT, Theme
from naisr_viewer.words.matrix import Heads

if TYPE_CHECKING:
    from naisr_viewer.views.shapes.canvas import Canvas
    from naisr_viewer.views.shapes.sub_plot import Hit

TURN_DEG, PAN, ZOOM = 7.5, 0.1, 1.15
"""What a key does to the camera: degrees, a share of half the height of a sub-plot, a factor."""

ARROWS = {Qt.Key.Key_Left: (-1, 0), Qt.Key.Key_Right: (1, 0), Qt.Key.Key_Up: (0, 1), Qt.Key.Key_Down: (0, -1)}
"""To the right and up."""

NEARER = (Qt.Key.Key_Plus, Qt.Key.Key_Equal)
FARTHER = (Qt.Key.Key_Minus, Qt.Key.Key_Underscore)

NO_FACES = np.zeros((0, 3), np.int64)


Marks = Mapping[Panel, Sequence[tuple[tuple[float, float, float], str]]]
"""Places (mm) and colours (``#rrggbb``) of the dots on each surface."""


Colours = Mapping[Panel, tuple[str, bool]]
"""Of surfaces (``#rrggbb``), and whether they are pale."""


class ShapeView(QWidget):
    """Template, effects, full shape and the sub-plots of patients, seen through one camera.

    It is long because the drawing library comes late: what is shown before is kept, and drawn when it comes.
    """

    scale_changed = Signal(float)  # pixels per millimetre, after zooming or resizing
    drawn = Signal(int)  # the picture is on its way to the screen; how many sub-plots were drawn anew
    limit_moved = Signal(object, float)  # a Panel, and what the end of its colour scale shall stand for
    fit_requested = Signal(object)  # a Panel whose colour scale shall fit what is shown
    clicked = Signal(object, object)  # a short click on a surface: its Panel, and the point there (mm)
    chosen = Signal(object)  # a short click on a sub-plot, beside its surface too: its Panel
    opened = Signal(object)  # a double click on a sub-plot, after that: its Panel
    hovered = Signal(object, object)  # the mouse rests over a surface: its Panel, and the Hit there
    left = Signal()  # what was told of the mouse holds no more

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("canvasArea")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        # A window of its own: Qt puts everything in a window with an OpenGL widget together by OpenGL, and
        # a moving slider beside it would have all of it put together once more.
        self.setAttribute(Qt.WidgetAttribute.WA_DontCreateNativeAncestors)
        self.setAttribute(Qt.WidgetAttribute.WA_NativeWindow)
        reserve_opengl(self)
        self._canvas: Canvas | None = None
        self._drawing = Drawing(self)
        self._drawing.arrived.connect(self._open_canvas)
        self._theme = LIGHT
        self._atlas: AtlasCard | None = None
        self._grid = Grid(self)
        self._visible: tuple[Panel, ...] = ()
        self._ghost: tuple[NDArray[np.float32] | None, NDArray[np.int64]] = (None, NO_FACES)
        self._marks: Marks = {}
        self._heads: Heads | None = None
        self._bands = HeadBands(self)
        self._colours: Colours = {}
        self._section: Section | None = None
        self._has_edges = False
        self._direction = OBLIQUE
        self._framed = self._looked_after = False
        self._moving = False
        self._wanted: Camera | None = None
        self._seen_mm = (1.0, 1.5)
        self._fit_scale = 1.0
        self._height = 1
        self._pixels_per_mm = 0.0
        self._turned: tuple[float, ...] = ()
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName("Shapes")
        self._ring = QFrame(self)
        self._ring.setObjectName("outline")
        self._ring.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self._ring.hide()
        self.row_bar = row_scroll(self)
        self.row_bar.valueChanged.connect(lambda _: self._arrange())
        self._area = QHBoxLayout(self)
        self._area.setContentsMargins(0, 0, 0, 0)
        self._area.setSpacing(0)
        self._area.addWidget(self.row_bar, 0, Qt.AlignmentFlag.AlignRight)

    @property
    def canvas(self) -> Canvas | None:
        """What draws the shapes; None as long as nothing can."""
        return self._canvas

    @property
    def is_ready(self) -> bool:
        """Whether surfaces are drawn as soon as they are shown."""
        return self._drawing.make_canvas is not None

    def prepare(self) -> None:
        """Load what draws the shapes, beside the window where that takes time."""
        self._drawing.fetch()

    def show_atlas(self, atlas: AtlasCard, theme: Theme) -> None:
        """Make one sub-plot per panel of ``atlas`` and of its patients, still without surfaces."""
        self.prepare()
        self._atlas, self._visible, self._wanted = atlas, (), None
        self._grid.fill(all_panels(atlas), atlas)
        self._turned = ()
        for panel, cell in self._grid.cells.items():
            if cell.bar is not None:
                cell.bar.limit_moved.connect(lambda limit, panel=panel: self.limit_moved.emit(panel, limit))
                cell.bar.fit_requested.connect(lambda panel=panel: self.fit_requested.emit(panel))
        self._ghost, self._marks, self._colours = (None, NO_FACES), {}, {}
        self._section = None
        self._direction = self._opening
        self._theme = theme
        self._open_canvas()

    def show_panels(self, panels: Sequence[Panel], heads: Heads | None = None) -> None:
        """Put these sub-plots on screen and hide the others.

        Args:
            panels: which.
            heads: names of their columns and rows; None where they have their own titles.
        """
        before, self._heads = self._heads, heads
        if tuple(panels) != self._visible:
            self._framed = self._framed and columns_of(panels) == columns_of(self._visible)
            self._visible = tuple(panels)
            self.row_bar.setValue(0)
            self._arrange()
            self._looked_after = False
            self._look_after()
        elif heads != before:
            self._arrange()

    def show_colours(self, colours: Colours) -> None:
        """Colour surfaces otherwise than their kind of view is."""
        self._colours = colours
        if self._canvas is not None:
            for panel, (colour, is_pale) in colours.items():
                self._canvas.set_colour(self._grid.index(panel), colour, is_pale)

    def outline(self, panel: Panel | None) -> None:
        """Draw a line around one sub-plot, or around none."""
        self._grid.outline(panel)

    def show_surface(self, result: SurfaceResult) -> None:
        """Replace one surface in place; all that are replaced before Qt paints again share one painting."""
        cell = self._grid.cells[result.request.panel]
        cell.result = result
        cell.show_scale(cell.scale)
        if self._canvas is not None:
            self._paint(result.request.panel)
            self._look_after()

    def show_scales(self, scales: Mapping[Panel, PanelScale | None]) -> None:
        """Say what the colours of surfaces stand for; those left out have none."""
        changed = [panel for panel, cell in self._grid.cells.items() if cell.scale != scales.get(panel)]
        if not changed:  # as long as a slider moves
            return
        had = self._strips
        for panel in changed:
            self._grid.cells[panel].show_scale(scales.get(panel))
            self._paint(panel)
        if self._strips != had:
            self._arrange()
        else:
            self._grid.show()

    def clear_surface(self, panel: Panel) -> None:
        """Show nothing until the next surface comes."""
        cell = self._grid.cells.get(panel)
        if cell is None:
            return
        cell.result = cell.cut = None
        self.set_caption(panel, "", "")
        if self._canvas is not None:
            self._canvas.clear_surface(self._grid.index(panel))
            self._canvas.set_cut(self._grid.index(panel), None)

    def show_ghost(self, points_mm: NDArray[np.float32] | None, faces: NDArray[np.int64] = NO_FACES) -> None:
        """Lay a scan over the full shape, translucent; without faces as dots.

        Args:
            points_mm: vertices, ``[n, dim]``; None takes the scan away.
            faces: vertex numbers of the triangles or segments, ``[m, dim]``; none for a cloud of points.
        """
        if points_mm is self._ghost[0] and faces is self._ghost[1]:
            return
        self._ghost = (points_mm, faces)
        if self._canvas is not None:
            self._canvas.set_ghost(self._grid.index(FULL_SHAPE), *self._ghost)

    def show_section(self, section: Section | None) -> None:
        """Show only what lies on one side of a plane; None shows all, and takes the cuts away."""
        self._section = section
        if self._canvas is not None:
            self._canvas.set_section(section)
        if section is None:
            for panel in self._grid.cells:
                self.show_cut(panel, None)

    def show_edges(self, has_edges: bool) -> None:
        """Draw the triangles of the surfaces, or not."""
        if has_edges != self._has_edges:
            self._has_edges = has_edges
            if self._canvas is not None:
                self._canvas.set_edges(has_edges)

    def show_cut(self, panel: Panel, cut: Cut | None) -> None:
        """Fill what the plane cuts of a surface, and tell its area; None takes that away."""
        cell = self._grid.cells[panel]
        if cut is not cell.cut:
            cell.cut = cut
            self._grid.say_again(panel)
            if self._canvas is not None:
                self._canvas.set_cut(self._grid.index(panel), cut)

    def show_marks(self, marks: Marks) -> None:
        """Mark places on surfaces, and no others."""
        before, self._marks = self._marks, marks
        for panel in [panel for panel in {**before, **marks} if before.get(panel) != marks.get(panel)]:
            self._mark(panel)

    def set_caption(self, panel: Panel, text: str, hint: str) -> None:
        """The line beneath a sub-plot, and more about it on hover."""
        self._grid.say(panel, text, hint)

    def caption(self, panel: Panel) -> str:
        """The line beneath a sub-plot."""
        return self._grid.cells[panel].caption.text()

    def title(self, panel: Panel) -> QLabel:
        """The label above a sub-plot."""
        return self._grid.cells[panel].title

    def set_moving(self, moving: bool) -> None:
        """Draw quickly while a slider moves, smoothly at rest."""
        self._moving = moving
        if self._canvas is not None:
            self._canvas.set_moving(moving)

    def set_theme(self, theme: Theme) -> None:
        """Follow the theme."""
        self._theme = theme
        if self._canvas is not None:
            self._canvas.set_colours(theme.canvas, ghost_colour(theme))

    def reset_camera(self) -> None:
        """The view that an atlas opens with: its direction, upright, with all that is on screen in it."""
        self._look(self._opening)

    @property
    def _opening(self) -> tuple[Direction, Direction]:
        return FLAT if self._is_flat else OBLIQUE

    @property
    def _is_flat(self) -> bool:
        return self._atlas is not None and self._atlas.is_flat

    def look_from(self, direction: str) -> None:
        """Stand at one of :data:`DIRECTIONS` and frame what is on screen."""
        self._look(DIRECTIONS[direction])

    @property
    def camera(self) -> Camera | None:
        """Where the camera stands; None before the first picture."""
        if self._canvas is None or not self._framed:
            return self._wanted
        eye = self._canvas.camera
        zoom = eye.parallel_scale / self._fit_scale
        return Camera(eye.position, eye.focal_point, eye.up, self._seen_mm, zoom)

    def set_camera(self, camera: Camera) -> None:
        """Let the camera stand there, now or as soon as there is something to see."""
        self._wanted = camera
        self._look_after()

    def clear(self) -> None:
        """Release the render window and all labels; nothing is drawn afterwards."""
        self._grid.clear()
        self._drawing.close()
        self._close_canvas()
        self._atlas, self._visible = None, ()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Rearrange for the new size."""
        super().resizeEvent(event)
        self._ring.setGeometry(self.rect())
        self._arrange()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """A click on words around a shape chooses its sub-plot; words pass it on to here."""
        super().mouseReleaseEvent(event)
        self._tell(self.chosen, event)

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        """The same of a double click."""
        super().mouseDoubleClickEvent(event)
        self._tell(self.opened, event)

    def focusInEvent(self, event: QFocusEvent) -> None:
        """A line around all shapes, unless a mouse brought the focus."""
        super().focusInEvent(event)
        self._ring.setVisible(event.reason() is not Qt.FocusReason.MouseFocusReason)
        self._ring.raise_()

    def focusOutEvent(self, event: QFocusEvent) -> None:
        """No line any more."""
        super().focusOutEvent(event)
        self._ring.hide()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Arrows turn the shapes, with Shift, and in the plane, they move them; + and - zoom."""
        key, canvas = event.key(), self._canvas
        if canvas is None or not self._framed:
            super().keyPressEvent(event)
        elif key in ARROWS:
            across, along = ARROWS[Qt.Key(key)]
            if event.modifiers() & Qt.KeyboardModifier.ShiftModifier or self._is_flat:
                canvas.pan(PAN * across, PAN * along)
            else:
                canvas.turn(-TURN_DEG * across, -TURN_DEG * along)
        elif key in NEARER or key in FARTHER:
            canvas.zoom_by(ZOOM if key in NEARER else 1 / ZOOM)
        else:
            super().keyPressEvent(event)

    def _tell(self, signal: SignalInstance, event: QMouseEvent) -> None:
        panel = self._grid.panel_at(event.position().toPoint())
        if panel is not None and event.button() is Qt.MouseButton.LeftButton:
            signal.emit(panel)

    def _open_canvas(self) -> None:
        """Start drawing anew, with all that was shown before."""
        self._close_canvas()
        make_canvas = self._drawing.make_canvas
        if make_canvas is None or self._atlas is None:
            return
        colours = [panel_colour(self._atlas, panel) for panel in self._grid.cells]
        self._canvas = make_canvas(colours, self, self._is_flat)
        self._canvas.drawn.connect(self._tell_drawn)
        self._canvas.clicked.connect(self._tell_clicked)
        self._canvas.chosen.connect(lambda index: self.chosen.emit(self._grid.panel(index)))
        self._canvas.opened.connect(lambda index: self.opened.emit(self._grid.panel(index)))
        self._canvas.hovered.connect(self._tell_hovered)
        self._canvas.left.connect(self.left)
        self._area.insertWidget(0, self._canvas, 1)
        self._canvas.show()  # the layout would only do so with the next turn of the event loop
        self._canvas.look(*self._direction)
        self._framed = self._looked_after = False
        self.set_theme(self._theme)
        self._canvas.set_moving(self._moving)
        for panel in self._grid.cells:
            self._paint(panel)
        self._canvas.set_ghost(self._grid.index(FULL_SHAPE), *self._ghost)
        for panel in self._marks:
            self._mark(panel)
        self.show_colours(self._colours)
        self._canvas.set_section(self._section)
        self._canvas.set_edges(self._has_edges)
        for panel, cell in self._grid.cells.items():
            self._canvas.set_cut(self._grid.index(panel), cell.cut)
        self._arrange()
        self._look_after()

    def _paint(self, panel: Panel) -> None:
        """A surface in the colours of its scale."""
        cell = self._grid.cells[panel]
        if cell.result is not None and self._canvas is not None:
            self._canvas.set_surface(self._grid.index(panel), replace(cell.result, colouring=cell.colouring))

    def _mark(self, panel: Panel) -> None:
        if self._canvas is not None:
            places = self._marks.get(panel, ())
            points_mm = np.array([point_mm for point_mm, _ in places], np.float32).reshape(-1, 3)
            self._canvas.set_marks(self._grid.index(panel), points_mm, [colour for _, colour in places])

    def _tell_clicked(self, index: int, point_mm: tuple[float, float, float]) -> None:
        self.clicked.emit(self._grid.panel(index), point_mm)

    def _tell_hovered(self, index: int, hit: Hit | None) -> None:
        if hit is not None:
            self.hovered.emit(self._grid.panel(index), hit)

    def _close_canvas(self) -> None:
        if self._canvas is not None:
            self._area.removeWidget(self._canvas)
            self._canvas.release()
            self._canvas = None

    def _look(self, direction: tuple[Direction, Direction]) -> None:
        self._direction = direction
        if self._canvas is not None:
            self._canvas.look(*direction)
            self._frame(self._canvas)

    def _frame(self, canvas: Canvas) -> None:
        """Frame what is on screen, keeping the direction."""
        box_mm = canvas.box_mm()
        if box_mm is not None:
            self._seen_mm = canvas.frame(box_mm)
            self._arrange()
            canvas.camera.parallel_scale = self._fit_scale

    def _stand(self, canvas: Canvas, camera: Camera) -> None:
        eye = canvas.camera
        eye.position, eye.focal_point, eye.up = camera.position_mm, camera.focus_mm, camera.up
        self._seen_mm = camera.framed_mm
        self._arrange()
        eye.parallel_scale = camera.zoom * self._fit_scale
        canvas.refresh()

    def _look_after(self) -> None:
        """Frame the first surfaces, and those of a layout in which nothing of one would be seen.

        Otherwise the camera is the user's.
        """
        if self._canvas is None or self._canvas.box_mm() is None:
            return
        if self._looked_after and self._wanted is None:
            return
        is_complete = all(self._grid.cells[panel].has_surface for panel in self._visible)
        if self._wanted is not None:
            self._stand(self._canvas, self._wanted)
            self._wanted, self._framed, self._looked_after = None, True, is_complete
            return
        if not self._framed or (is_complete and self._canvas.is_any_missed()):
            self._frame(self._canvas)
        self._framed, self._looked_after = self._framed or is_complete, is_complete

    def _arrange(self) -> None:
        """Divide the canvas among the visible panels, keeping the user's zoom."""
        if not self._visible or not self.width() or not self.height():
            return
        wide_mm, high_mm = self._seen_mm
        strips = self._strips
        rows, room = self._rows(strips, wide_mm / high_mm)
        show_rows(self.row_bar, rows)
        places = areas_for(len(self._visible), self._within(room), rows, self.row_bar.value())
        areas = {
            panel: area.translated(self._margins.left(), self._margins.top())
            for panel, area in zip(self._visible, places, strict=True)
            if area is not None
        }
        first = next(iter(areas.values()))
        self._height = first.height()
        old_fit, self._fit_scale = self._fit_scale, scale_to_fit(first, strips, wide_mm, high_mm)
        if self._canvas is not None:
            self._canvas.camera.parallel_scale *= self._fit_scale / old_fit
            self._canvas.set_eye_level(eye_level(first, strips))
            ports = {panel: viewport(area, room) for panel, area in areas.items()}
            self._canvas.set_viewports([ports.get(panel) for panel in self._grid.cells])
        self._grid.place(areas, strips)
        self._bands.place(self._heads, areas, room)

    def _rows(self, strips: Strips, aspect: float) -> tuple[Rows, QSize]:
        """How the panels are divided, and the room that they have beside a scroll bar where one is needed."""
        rows = self._divided(self.size(), strips, aspect)
        if rows.in_sight == rows.total:
            return rows, self.size()
        room = QSize(self.width() - self.row_bar.sizeHint().width(), self.height())
        return self._divided(room, strips, aspect), room

    def _divided(self, room: QSize, strips: Strips, aspect: float) -> Rows:
        count, columns = len(self._visible), columns_of(self._visible)
        if columns:
            return rows_of(count, columns, self._within(room), strips)
        return rows_for(count, self._within(room), strips, aspect)

    def _within(self, room: QSize) -> QSize:
        """What is left beside the heads."""
        return room.shrunkBy(self._margins)

    @property
    def _strips(self) -> Strips:
        return strips_of({panel: self._grid.cells[panel] for panel in self._visible})

    @property
    def _margins(self) -> QMargins:
        return QMargins() if self._heads is None else MARGINS

    def _tell_drawn(self, count: int) -> None:
        if self._canvas is not None and self._framed:
            scale = self._height / (2 * self._canvas.camera.parallel_scale)
            if scale != self._pixels_per_mm:
                self._pixels_per_mm = scale
                self.scale_changed.emit(scale)
        if self._canvas is not None:
            self._turn_compasses(self._canvas)
        self.drawn.emit(count)

    def _turn_compasses(self, canvas: Canvas) -> None:
        """Have them follow the camera, if it has turned."""
        right, up = axes_of(canvas.camera)
        turned = (*right.tolist(), *up.tolist())
        if turned != self._turned:
            self._turned = turned
            self._grid.turn(right.tolist(), up.tolist())
