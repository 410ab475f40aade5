"""How sub-plots share the canvas: pure geometry."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from PySide6.QtCore import QRect, QSize

LEAST_WIDTH_PX = 150
"""Of a panel; captions are hardly wider."""

Viewport = tuple[float, float, float, float]
"""Left, bottom, right and top as shares of the canvas, counted from its lower left corner."""


class Strips(NamedTuple):
    """How the height of a panel is shared (px); words lie over whatever of a shape grows into theirs.

    Attributes:
        title: above the shape.
        bar: beneath it, for a colour bar.
        caption: beneath that.
        least_shape: of a shape; rows that would leave less are scrolled to.
        room: a shape is framed with so many times its size, so that it can grow while a slider moves.
    """

    title: int = 36
    bar: int = 0
    caption: int = 52
    least_shape: int = 80
    room: float = 1.25

    @property
    def words(self) -> int:
        """All but the shape."""
        return self.title + self.bar + self.caption


CELL_STRIPS = Strips(title=0, caption=34, least_shape=56, room=1.1)
"""Of a cell of the matrix, which is named at the ends of its column and row and framed with larger ones."""


class Rows(NamedTuple):
    """How panels are divided into rows.

    Attributes:
        columns: panels in a row.
        total: rows in all.
        in_sight: rows on screen at a time.
    """

    columns: int
    total: int
    in_sight: int


def rows_for(count: int, canvas: QSize, strips: Strips, shape_aspect: float) -> Rows:
    """The grid of ``count`` panels in which a shape is drawn largest and captions have their room.

    Args:
        count: how many panels.
        canvas: its size (px).
        strips: what stands above and beneath every shape.
        shape_aspect: width over height of a shape as seen.
    """

    def grid(columns: int) -> Rows:
        return rows_of(count, columns, canvas, strips)

    def shape_px(rows: Rows) -> float:
        high = height_left(canvas.height() / rows.in_sight, strips)
        return min(high, canvas.width() / rows.columns / shape_aspect)

    wide_enough = [columns for columns in range(1, count + 1) if canvas.width() >= columns * LEAST_WIDTH_PX]
    grids = [grid(columns) for columns in wide_enough or [1]]
    return max(grids, key=lambda rows: (rows.in_sight - rows.total, round(shape_px(rows), 6), -rows.columns))


def rows_of(count: int, columns: int, canvas: QSize, strips: Strips) -> Rows:
    """The rows of ``count`` panels where so many are beside each other."""
    rows = -(-count // columns)
    most = max(1, canvas.height() // (strips.words + strips.least_shape))
    return Rows(columns, rows, min(rows, most))


def cells(count: int, columns: int) -> list[tuple[float, float, float, float]]:
    """Left, top, width and height of each panel as shares of the canvas; the last fills its row."""
    rows = -(-count // columns)
    width, height = 1 / columns, 1 / rows
    places = [((i % columns) * width, (i // columns) * height, width, height) for i in range(count)]
    left, top, _, _ = places[-1]
    return [*places[:-1], (left, top, 1 - left, height)]


def areas_for(count: int, canvas: QSize, rows: Rows, first_row: int = 0) -> list[QRect | None]:
    """Where each of ``count`` panels is on a canvas (px), words included; None of one that is out of sight.

    Args:
        count: how many panels.
        canvas: its size (px).
        rows: how they are divided.
        first_row: the uppermost row in sight.
    """
    height = canvas.height() / rows.in_sight
    whole = _pixels_of(cells(count, rows.columns), canvas.width(), height * rows.total, height * first_row)
    return [area if 0 <= area.top() < canvas.height() else None for area in whole]


def _pixels_of(
    places: Sequence[tuple[float, float, float, float]], width: float, height: float, scrolled: float
) -> list[QRect]:
    """Whole pixels; edges that two panels share are the same ones."""
    areas = []
    for left, top, wide, high in places:
        x, y = round(left * width), round(top * height - scrolled)
        right, bottom = round((left + wide) * width), round((top + high) * height - scrolled)
        areas.append(QRect(x, y, right - x, bottom - y))
    return areas


def drawn_height(area: QRect, strips: Strips) -> int:
    """Pixels left for the shape between the title and what stands beneath it.

    Args:
        area: where the panel is (px).
        strips: what stands above and beneath every shape.
    """
    return round(height_left(area.height(), strips))


def height_left(height: float, strips: Strips) -> float:
    """What title, caption and colour bars leave of a panel's height (px), and never less than a third."""
    return max(height - strips.words, height / 3, 1)


def viewport(area: QRect, canvas: QSize) -> Viewport:
    """What of the canvas is drawn on for ``area``: all of it, so that nothing is cut along the words."""
    left, right = area.left() / canvas.width(), (area.left() + area.width()) / canvas.width()
    top, bottom = area.top() / canvas.height(), (area.top() + area.height()) / canvas.height()
    return left, 1 - bottom, right, 1 - top


def eye_level(area: QRect, strips: Strips) -> float:
    """How far the middle between title and caption is above that of the panel, in halves of its height."""
    above = (strips.caption + strips.bar - strips.title) / max(area.height(), 1)
    return min(above, 1 - drawn_height(area, strips) / max(area.height(), 1))


def scale_to_fit(area: QRect, strips: Strips, wide_mm: float, high_mm: float) -> float:
    """Millimetres from the middle to the top of a panel between whose words a box so wide and high fits."""
    drawn_px = drawn_height(area, strips)
    return strips.room * max(high_mm / drawn_px, wide_mm / area.width()) * area.height() / 2


def separators(areas: Sequence[QRect]) -> set[tuple[int, int, int, int]]:
    """Left, top, width and height of the lines between sub-plots."""
    beside = {(area.left(), area.top(), 1, area.height()) for area in areas if area.left() > 0}
    return beside | {(area.left(), area.top(), area.width(), 1) for area in areas if area.top() > 0}
