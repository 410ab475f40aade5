"""How sub-plots share the canvas."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QSize

from naisr_viewer.views.shapes.arrangement import cells, columns_for


def test_cells_cover_the_canvas_without_overlap():
    for count in range(1, 9):
        for columns in range(1, count + 1):
            boxes = cells(count, columns)
            assert len(boxes) == count
            assert sum(width * height for _, _, width, height in boxes) == pytest.approx(1)


def test_tall_shapes_stand_in_a_row_and_flat_ones_are_stacked():
    assert columns_for(5, QSize(1600, 800), strip=0, shape_aspect=0.3) == 5
    assert columns_for(5, QSize(500, 1000), strip=0, shape_aspect=4.0) == 1
    assert columns_for(5, QSize(1960, 1400), strip=0, shape_aspect=0.9) == 3
    assert columns_for(1, QSize(1400, 1000), strip=0, shape_aspect=0.9) == 1


def test_words_and_colour_bars_count_as_lost_height():
    """Two rows would leave each shape 222 px, four columns 300."""
    assert columns_for(4, QSize(660, 696), strip=38, shape_aspect=0.55) == 4
    assert columns_for(4, QSize(660, 696), strip=38, shape_aspect=1.0) == 2


def test_no_panel_is_narrower_than_its_caption():
    assert columns_for(5, QSize(460, 700), strip=38, shape_aspect=0.3) == 3
    assert columns_for(5, QSize(120, 700), strip=38, shape_aspect=0.3) == 1
