"""How sub-plots share the canvas: pure geometry."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QRect, QSize

TITLE_PX = 36
CAPTION_PX = 52
"""Strips above and beneath each shape, kept free for words."""

LEAST_WIDTH_PX = 150
"""Of a panel; captions are hardly wider."""

ROOM = 1.25
"""A shape is framed with this much room, so that it can grow while a slider moves."""

Viewport = tuple[float, float, float, float]
"""Left, bottom, right and top as shares of the canvas, counted from its lower left corner."""


def columns_for(count: int, canvas: QSize, strip: int, shape_aspect: float) -> int:
    """Columns of a grid of ``count`` panels in which a shape is drawn largest and captions have their room.

    Args:
        count: how many panels.
        canvas: its size (px).
        strip: pixels beneath every shape for colour bars.
        shape_aspect: width over height of a shape as seen.
    """

    def shape_px(columns: int) -> float:
        rows = -(-count // columns)
        return min(height_left(canvas.height() / rows, strip), canvas.width() / columns / shape_aspect)

    wide_enough = [columns for columns in range(1, count + 1) if canvas.width() >= columns * LEAST_WIDTH_PX]
    return max(wide_enough or [1], key=lambda columns: (round(shape_px(columns), 6), -columns))


def cells(count: int, columns: int) -> list[tuple[float, float, float, float]]:
    """Left, top, width and height of each panel as shares of the canvas; the last fills its row."""
    rows = -(-count // columns)
    width, height = 1 / columns, 1 / rows
    places = [((i % columns) * width, (i // columns) * height, width, height) for i in range(count)]
    left, top, _, _ = places[-1]
    return [*places[:-1], (left, top, 1 - left, height)]


def areas_for(count: int, canvas: QSize, strip: int, shape_aspect: float) -> list[QRect]:
    """Where each of ``count`` panels is on a canvas (px), words included.

    Args:
        count: how many panels.
        canvas: its size (px).
        strip: pixels beneath every shape for colour bars.
        shape_aspect: width over height of a shape as seen.
    """
    columns = columns_for(count, canvas, strip, shape_aspect)
    return [_pixels(place, canvas) for place in cells(count, columns)]


def _pixels(place: tuple[float, float, float, float], canvas: QSize) -> QRect:
    left, top = round(place[0] * canvas.width()), round(place[1] * canvas.height())
    right, bottom = (place[0] + place[2]) * canvas.width(), (place[1] + place[3]) * canvas.height()
    return QRect(left, top, round(right) - left, round(bottom) - top)


def drawn_height(area: QRect, strip: int) -> int:
    """Pixels left for the shape between the title and what stands beneath it.

    Args:
        area: where the panel is (px).
        strip: pixels beneath every shape for colour bars.
    """
    return round(height_left(area.height(), strip))


def height_left(height: float, strip: int) -> float:
    """What title, caption and colour bars leave of a panel's height (px)."""
    return max(height - TITLE_PX - CAPTION_PX - strip, 1)


def viewport(area: QRect, canvas: QSize, strip: int) -> Viewport:
    """Where the shape is drawn inside ``area``, between its title and its caption."""
    top = area.top() + TITLE_PX
    bottom = top + drawn_height(area, strip)
    left, right = area.left() / canvas.width(), (area.left() + area.width()) / canvas.width()
    return left, 1 - bottom / canvas.height(), right, 1 - top / canvas.height()


def scale_to_fit(area: QRect, strip: int, wide_mm: float, high_mm: float) -> float:
    """Millimetres from the middle to the top of a sub-plot in which a box so wide and high fits."""
    return ROOM * max(high_mm, wide_mm * drawn_height(area, strip) / area.width()) / 2


def separators(areas: Sequence[QRect]) -> set[tuple[int, int, int, int]]:
    """Left, top, width and height of the lines between sub-plots."""
    beside = {(area.left(), area.top(), 1, area.height()) for area in areas if area.left() > 0}
    return beside | {(area.left(), area.top(), area.width(), 1) for area in areas if area.top() > 0}
