"""How long a millimetre is on screen."""

from __future__ import annotations

import pytest

from naisr_viewer.views.shapes.scale_bar import round_length_mm


@pytest.mark.parametrize(("pixels_per_mm", "length_mm"), [(1.0, 50), (0.9, 100), (4.0, 20), (100.0, 0.5)])
def test_scale_bars_have_round_lengths(pixels_per_mm, length_mm):
    assert round_length_mm(pixels_per_mm) == pytest.approx(length_mm)
