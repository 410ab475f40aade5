"""Where the camera stands and what it sees."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from naisr_viewer.views.shapes.camera import aim, seen_size


def test_a_box_is_seen_at_its_true_size():
    camera = pv.Camera()
    camera.focal_point, camera.position, camera.up = (0, 0, 0), (0, -1, 0), (0, 0, 1)
    box = np.array([[-1.0, 1.0], [-2.0, 2.0], [0.0, 6.0]])
    aim(camera, box)
    assert seen_size(camera, box) == pytest.approx((2.0, 6.0))
    np.testing.assert_allclose(camera.focal_point, [0, 0, 3])
