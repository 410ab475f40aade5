"""Where the camera stands and what it sees."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from naisr_viewer.views.shapes.camera import aim, is_any_seen, seen_size


def test_a_box_is_seen_at_its_true_size():
    camera = pv.Camera()
    camera.focal_point, camera.position, camera.up = (0, 0, 0), (0, -1, 0), (0, 0, 1)
    box = np.array([[-1.0, 1.0], [-2.0, 2.0], [0.0, 6.0]])
    aim(camera, box)
    assert seen_size(camera, box) == pytest.approx((2.0, 6.0))
    np.testing.assert_allclose(camera.focal_point, [0, 0, 3])


def test_what_is_outside_a_sub_plot_is_not_seen():
    camera = pv.Camera()
    camera.focal_point, camera.position, camera.up = (0, 0, 0), (0, -9, 0), (0, 0, 1)
    camera.parallel_scale = 10.0  # millimetres from the middle to the top
    assert is_any_seen(camera, np.array([[4.9, 0.0, 0.0], [90.0, 0, 0]]), aspect=0.5)
    assert not is_any_seen(camera, np.array([[5.1, 0.0, 0.0], [90.0, 0, 0]]), aspect=0.5)
    assert not is_any_seen(camera, np.array([[0.0, 5.0, 10.5]]), aspect=0.5)
    camera.SetWindowCenter(0.0, 0.2)  # the middle of the sub-plot is 2 mm higher
    assert is_any_seen(camera, np.array([[0.0, 5.0, 10.5]]), aspect=0.5)
