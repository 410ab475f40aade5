"""The matrix as a figure for print: words and lines as vectors, each shape as a picture at 300 dots an inch.

Matplotlib is imported when a figure is made, and without its state of a current figure: it runs beside the
window, in any thread.
"""

from __future__ import annotations

import io
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from naisr_model.progress import SILENT, Progress
from naisr_viewer.state.camera import Camera
from naisr_viewer.state.layouts import Cell
from naisr_viewer.state.requests import SurfaceResult
from naisr_viewer.words.matrix import Heads

if TYPE_CHECKING:
    from matplotlib.collections import Collection
    from matplotlib.figure import Figure

DOTS_PER_INCH = 300
FINER = 2
"""Dots are averaged of so many squared, so that edges are smooth."""

CELL_IN, WORDS_IN = 1.25, 0.34
"""Width of a cell and height of its shape, and of the lines beneath it."""

ROW_IN = CELL_IN + WORDS_IN

LEFT_IN, TOP_IN, BOTTOM_IN, RIGHT_IN = 0.62, 0.62, 0.5, 0.12
"""What is left around the cells."""

ROOM = 1.08
"""A shape is framed with so many times its size."""

AMBIENT, DIFFUSE = 0.3, 0.75
"""Light on a surface, from where it is seen."""

OUTLINE, OUTLINE_PT = 0.55, 0.7
"""How dark a curve is against what it encloses, and how wide."""

LINE, INK, GREY = "#c9cdd4", "#1d2430", "#667085"

STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 8,
    "svg.fonttype": "none",
    "pdf.fonttype": 42,
    "svg.hashsalt": "matrix",
}
"""Text stays text in both formats."""

Box = tuple[float, float, float, float]
"""Left, right, bottom and top, in mm as seen."""


@dataclass(frozen=True, eq=False)
class Plate:
    """One cell of the figure.

    Attributes:
        surface: its shape.
        colour: of that, ``#rrggbb``.
        lines: what stands beneath.
    """

    surface: SurfaceResult
    colour: str
    lines: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class MatrixFigure:
    """All that a figure shows.

    Attributes:
        across, down: what changes along the columns and rows.
        heads: at their ends.
        plates: the cells.
        note: beneath all of it.
        camera: from where surfaces are seen; how near it is does not matter.
        unit: of length.
    """

    across: str
    down: str
    heads: Heads
    plates: Mapping[Cell, Plate]
    note: str
    camera: Camera
    unit: str


def figure_bytes(figure: MatrixFigure, ending: str, progress: Progress = SILENT) -> bytes:
    """The contents of a file ``pdf`` or ``svg``; the same figure gives the same bytes.

    Raises:
        Cancelled: when nobody waits any more.
    """
    from matplotlib import rc_context

    box, content = _common_box(figure), io.BytesIO()
    pieces = progress.over(list(figure.plates.items()))
    images = {
        cell: shape_image(plate.surface, plate.colour, figure.camera, box) for (cell, plate), _ in pieces
    }
    dateless = {"Date": None} if ending == "svg" else {"CreationDate": None}
    with rc_context(STYLE):
        _drawn(figure, images, box).savefig(content, format=ending, metadata=dateless)
    return content.getvalue()


def as_seen(vectors: NDArray[np.floating], camera: Camera) -> NDArray[np.float64]:
    """Vectors ``[n, 3]`` to the right, upwards and towards the eye, without perspective."""
    back = np.subtract(camera.position_mm, camera.focus_mm)
    back /= np.linalg.norm(back)
    right = np.cross(camera.up, back)
    right /= np.linalg.norm(right)
    seen: NDArray[np.float64] = vectors @ np.stack([right, np.cross(back, right), back], axis=1)
    return seen


def points_seen(surface: SurfaceResult, camera: Camera) -> NDArray[np.floating]:
    """Its vertices to the right and upwards, ``[n, 2]``; curves in the plane are seen as they are."""
    return surface.points_mm if surface.dim == 2 else as_seen(surface.points_mm, camera)[:, :2]


def shape_image(surface: SurfaceResult, colour: str, camera: Camera, box: Box) -> NDArray[np.uint8]:
    """A lit surface on nothing, or what a curve encloses: red, green, blue and opacity, ``[dots, dots, 4]``.

    Triangles that face the eye are drawn from the farthest to the nearest.
    """
    own = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    if surface.dim == 2:
        return _averaged(_painted(_enclosed(surface, own), box))
    triangles = as_seen(surface.points_mm, camera)[surface.faces]
    edges = np.diff(triangles, axis=1)
    facing = np.flatnonzero(np.cross(edges[:, 0], edges[:, 1])[:, 2] > 0)
    order = facing[np.argsort(triangles[facing, :, 2].mean(axis=1))]
    light = as_seen(surface.normals, camera)[surface.faces[order]][..., 2].mean(axis=1).clip(0, 1)
    colours = (own * (AMBIENT + DIFFUSE * light)[:, None]).clip(0, 1)
    return _averaged(_painted(_triangles(triangles[order, :, :2], colours), box))


def _triangles(triangles: NDArray[np.float64], colours: NDArray[np.float64]) -> Collection:
    """Triangles ``[n, 3, 2]`` in their colours ``[n, 3]``, each over those before it."""
    from matplotlib.collections import PolyCollection

    return PolyCollection(list(triangles), facecolors=colours, antialiased=False)


def _enclosed(curve: SurfaceResult, colour: NDArray[np.float64]) -> Collection:
    """What a curve encloses in a colour ``[3]``, without its holes, and the curve darker."""
    from matplotlib.collections import PathCollection
    from matplotlib.path import Path

    from naisr_model.shapes.curve import Curve

    loops = [np.append(loop, loop[:1]) for loop in Curve(curve.points_mm.astype(float), curve.faces).loops]
    path = Path.make_compound_path(*(Path(curve.points_mm[loop], closed=True) for loop in loops))
    return PathCollection([path], facecolors=[colour], edgecolors=[OUTLINE * colour], linewidths=OUTLINE_PT)


def _painted(artist: Collection, box: Box) -> NDArray[np.uint8]:
    """Shapes on a square sheet that holds a box."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    sheet = Figure((CELL_IN, CELL_IN), dpi=DOTS_PER_INCH * FINER)
    sheet.patch.set_alpha(0.0)
    axes = sheet.add_axes((0, 0, 1, 1), xlim=box[:2], ylim=box[2:])
    axes.set_axis_off()
    axes.add_collection(artist, autolim=False)
    canvas = FigureCanvasAgg(sheet)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())


def _averaged(dots: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Squares of dots made one, weighing colours by opacity."""
    high, wide = dots.shape[0] // FINER, dots.shape[1] // FINER
    squares = dots[: high * FINER, : wide * FINER].reshape(high, FINER, wide, FINER, 4).astype(float)
    opacity = squares[..., 3:].sum(axis=(1, 3))
    colour = (squares[..., :3] * squares[..., 3:]).sum(axis=(1, 3)) / np.maximum(opacity, 1.0)
    return np.concatenate([colour, opacity / FINER**2], axis=2).round().astype(np.uint8)


def _common_box(figure: MatrixFigure) -> Box:
    """A square around all shapes as they are seen, so that they can be compared."""
    seen = [points_seen(plate.surface, figure.camera) for plate in figure.plates.values()]
    points = np.concatenate(seen)
    low, high = points.min(axis=0), points.max(axis=0)
    (x, y), half = (low + high) / 2, ROOM * float((high - low).max()) / 2
    return float(x) - half, float(x) + half, float(y) - half, float(y) + half


class Sheet:
    """Paper on which places are told in inches from the left and from the top.

    Args:
        wide, high: its size in inches.
    """

    def __init__(self, wide: float, high: float) -> None:
        from matplotlib.figure import Figure

        self.wide, self.high = wide, high
        self.figure = Figure((wide, high))

    def write(self, x: float, y: float, text: str, **looks: Any) -> None:
        """Text around a place."""
        looks = {"ha": "center", "va": "center", "color": INK} | looks
        self.figure.text(x / self.wide, 1 - y / self.high, text, **looks)

    def rule(self, x: tuple[float, float], y: tuple[float, float], colour: str, points: float) -> None:
        """A line from one place to another, so many points wide."""
        from matplotlib.lines import Line2D

        xs, ys = np.array(x) / self.wide, 1 - np.array(y) / self.high
        self.figure.add_artist(Line2D(xs, ys, color=colour, linewidth=points))

    def paste(self, x: float, y: float, image: NDArray[np.uint8]) -> None:
        """A picture of a shape, its upper left corner at a place."""
        place = (x / self.wide, 1 - (y + CELL_IN) / self.high, CELL_IN / self.wide, CELL_IN / self.high)
        axes = self.figure.add_axes(place)
        axes.set_axis_off()
        axes.imshow(image, interpolation="none", aspect="auto")


def _drawn(figure: MatrixFigure, images: Mapping[Cell, NDArray[np.uint8]], box: Box) -> Figure:
    columns, rows = len(figure.heads.across), len(figure.heads.down)
    sheet = Sheet(LEFT_IN + columns * CELL_IN + RIGHT_IN, TOP_IN + rows * ROW_IN + BOTTOM_IN)
    for (column, row), image in images.items():
        left, top = LEFT_IN + column * CELL_IN, TOP_IN + row * ROW_IN
        lines = "\n".join(figure.plates[column, row].lines)
        sheet.paste(left, top, image)
        sheet.write(left + CELL_IN / 2, top + CELL_IN, lines, va="top", fontsize=7)
    _write_heads(sheet, figure)
    _rule(sheet, columns, rows)
    _write_note(sheet, figure, (box[1] - box[0]) / CELL_IN)
    return sheet.figure


def _write_heads(sheet: Sheet, figure: MatrixFigure) -> None:
    """The values along both sides, and above them what they are of."""
    across, down = figure.heads.across, figure.heads.down
    for column, text in enumerate(across):
        sheet.write(LEFT_IN + (column + 0.5) * CELL_IN, TOP_IN - 0.14, text)
    for row, text in enumerate(down):
        sheet.write(LEFT_IN - 0.14, TOP_IN + (row + 0.5) * ROW_IN, text, rotation=90)
    sheet.write(LEFT_IN + len(across) / 2 * CELL_IN, 0.2, figure.across, fontweight="bold")
    sheet.write(0.2, TOP_IN + len(down) / 2 * ROW_IN, figure.down, rotation=90, fontweight="bold")


def _rule(sheet: Sheet, columns: int, rows: int) -> None:
    """Lines around the cells, heavier beside the axes."""
    ends_x, ends_y = (LEFT_IN, LEFT_IN + columns * CELL_IN), (TOP_IN, TOP_IN + rows * ROW_IN)
    for column in range(columns + 1):
        x = LEFT_IN + column * CELL_IN
        sheet.rule((x, x), ends_y, *_pen(column))
    for row in range(rows + 1):
        y = TOP_IN + row * ROW_IN
        sheet.rule(ends_x, (y, y), *_pen(row))


def _pen(place: int) -> tuple[str, float]:
    return (GREY, 1.0) if place == 1 else (LINE, 0.5)


def _write_note(sheet: Sheet, figure: MatrixFigure, mm_an_inch: float) -> None:
    """What all of it is of, and how long a round length is."""
    length_mm = _round_length(0.8 * CELL_IN * mm_an_inch)
    right, y = sheet.wide - RIGHT_IN, sheet.high - 0.3
    left = right - length_mm / mm_an_inch
    sheet.rule((left, right), (y, y), INK, 1.2)
    sheet.write((left + right) / 2, y + 0.12, f"{length_mm:g} {figure.unit}")
    sheet.write(LEFT_IN, y, figure.note, ha="left", color=GREY, fontsize=7)


def _round_length(longest_mm: float) -> float:
    """The longest of 1, 2, 5, 10, 20, 50 ... mm that is at most so long."""
    decade = 10.0 ** math.floor(math.log10(longest_mm))
    return max(step * decade for step in (1, 2, 5) if step * decade <= longest_mm)
