"""How sub-plots share the canvas."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QRect, QSize

from naisr_viewer.views.shapes.arrangement import (
    Strips,
    areas_for,
    cells,
    drawn_height,
    eye_level,
    rows_for,
    viewport,
)


def test_cells_cover_the_canvas_without_overlap():
    for count in range(1, 9):
        for columns in range(1, count + 1):
            boxes = cells(count, columns)
            assert len(boxes) == count
            assert sum(width * height for _, _, width, height in boxes) == pytest.approx(1)


def test_tall_shapes_stand_in_a_row_and_flat_ones_are_stacked():
    assert rows_for(5, QSize(1600, 800), strips=Strips(), shape_aspect=0.3).columns == 5
    assert rows_for(5, QSize(500, 1000), strips=Strips(), shape_aspect=4.0).columns == 1
    assert rows_for(5, QSize(1960, 1400), strips=Strips(), shape_aspect=0.9).columns == 3
    assert rows_for(1, QSize(1400, 1000), strips=Strips(), shape_aspect=0.9).columns == 1


def test_words_and_colour_bars_count_as_lost_height():
    """Two rows would leave each shape 222 px, four columns 300."""
    assert rows_for(4, QSize(660, 696), strips=Strips(bar=38), shape_aspect=0.55).columns == 4
    assert rows_for(4, QSize(660, 696), strips=Strips(bar=38), shape_aspect=1.0).columns == 2


def test_no_panel_is_narrower_than_its_caption():
    assert rows_for(5, QSize(460, 700), strips=Strips(bar=38), shape_aspect=0.3).columns == 3
    assert rows_for(5, QSize(120, 700), strips=Strips(bar=38), shape_aspect=0.3).columns == 1


@pytest.mark.parametrize("bar", [0, 38])
@pytest.mark.parametrize("size", [QSize(504, 495), QSize(420, 295), QSize(144, 295), QSize(1960, 1290)])
def test_every_panel_can_be_scrolled_to_and_leaves_its_shape_some_room(size, bar):
    rows = rows_for(5, size, Strips(bar=bar), shape_aspect=0.4)
    seen: set[int] = set()
    for first in range(rows.total - rows.in_sight + 1):
        areas = areas_for(5, size, rows, first)
        shown = {index: area for index, area in enumerate(areas) if area is not None}
        seen |= set(shown)
        for area in shown.values():
            assert QRect(0, 0, size.width(), size.height()).contains(area)
            assert drawn_height(area, Strips(bar=bar)) >= Strips().least_shape
    assert seen == set(range(5))


@pytest.mark.parametrize("size", [QSize(641, 479), QSize(1001, 777), QSize(333, 601)])
def test_panels_leave_no_pixel_to_nobody(size):
    """Edges that two panels share are the same number, so that rounding brings them to the same pixel."""
    rows = rows_for(5, size, Strips(), shape_aspect=0.9)
    areas = [area for area in areas_for(5, size, rows) if area is not None]
    ports = [viewport(area, size) for area in areas]
    assert sum(area.width() * area.height() for area in areas) == size.width() * size.height()
    lefts, rights = {port[0] for port in ports}, {port[2] for port in ports}
    assert lefts - {0.0} == rights - {1.0}
    assert {port[1] for port in ports} - {0.0} == {port[3] for port in ports} - {1.0}


def test_a_shape_is_drawn_in_the_middle_between_its_words():
    area = QRect(0, 0, 300, 400)  # 36 px above and 52 px beneath: the middle is 192 px from the top
    assert eye_level(area, strips=Strips()) == pytest.approx((200 - 192) / 200)
