"""How surfaces look."""

from __future__ import annotations

import numpy as np
import trimesh
from PySide6.QtGui import QColor

from naisr_viewer.views.shapes.looks import is_closed, look_up_table


def test_closed_surfaces_are_told_from_open_ones():
    faces = trimesh.creation.icosphere(subdivisions=1).faces
    assert is_closed(faces)
    assert not is_closed(faces[:-1])
    assert not is_closed(np.vstack([faces[:-1], faces[-1][::-1]]))
    assert not is_closed(faces[:0])


def test_values_beyond_the_ends_have_the_colours_of_the_ends():
    table = look_up_table(2.0, scale="signed")
    for value, end in ((-9.0, "#2957a8"), (-2.0, "#2957a8"), (2.0, "#aa3600"), (9.0, "#aa3600")):
        assert QColor.fromRgbF(*table.map_value(value, opacity=False)).name() == end
