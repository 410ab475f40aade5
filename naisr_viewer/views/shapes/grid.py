"""How sub-plots share the canvas: pure geometry."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QRect


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


def separators(areas: Sequence[QRect]) -> set[tuple[int, int, int, int]]:
    """Left, top, width and height of the lines between sub-plots."""
    beside = {(area.left(), area.top(), 1, area.height()) for area in areas if area.left() > 0}
    return beside | {(area.left(), area.top(), area.width(), 1) for area in areas if area.top() > 0}
