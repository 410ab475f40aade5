"""How sub-plots share the canvas."""

from __future__ import annotations

import pytest

from naisr_viewer.views.shapes.arrangement import cells, columns_for


def test_cells_cover_the_canvas_without_overlap():
    for count in range(1, 9):
        for columns in range(1, count + 1):
            boxes = cells(count, columns)
            assert len(boxes) == count
            assert sum(width * height for _, _, width, height in boxes) == pytest.approx(1)


def test_tall_shapes_stand_in_a_row_and_flat_ones_are_stacked():
    assert columns_for(5, canvas_aspect=2.0, shape_aspect=0.3) == 5
    assert columns_for(5, canvas_aspect=0.5, shape_aspect=4.0) == 1
    assert columns_for(5, canvas_aspect=1.4, shape_aspect=0.9) == 3
    assert columns_for(1, canvas_aspect=1.4, shape_aspect=0.9) == 1
