"""Where the camera stands and what it sees."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from naisr_viewer.views.shapes.camera import aim, centre_on, is_any_seen, pan, seen_size, turn, zoom_at


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


def stand(*direction: float) -> pv.Camera:
    camera = pv.Camera()
    camera.focal_point, camera.position, camera.up = (
        (1, 2, 3),
        (1 + direction[0], 2 + direction[1], 3),
        (0, 0, 1),
    )
    camera.parallel_scale = 10.0
    return camera


def place_of(camera: pv.Camera, point, aspect: float) -> np.ndarray:
    """Where a point is drawn, 1 at the edges of a sub-plot: VTK's own projection."""
    full = camera.GetCompositeProjectionTransformMatrix(aspect, -1, 1)
    seen = np.array(full.MultiplyPoint((*point, 1.0)))
    return seen[:2] / seen[3]


def test_zooming_keeps_what_is_under_the_pointer_there():
    camera, point = stand(-4.0, 3.0), (5.0, 4.0, 9.0)
    camera.parallel_projection = True
    camera.SetWindowCenter(0.0, 0.2)
    place = place_of(camera, point, 0.6)
    zoom_at(camera, 2.5, tuple(place), 0.6)
    assert camera.parallel_scale == pytest.approx(4.0)
    np.testing.assert_allclose(place_of(camera, point, 0.6), place, atol=1e-9)


def test_panning_moves_the_shapes_and_centring_brings_a_point_to_the_middle():
    camera = stand(0.0, -5.0)
    camera.parallel_projection = True
    before = place_of(camera, (0, 0, 0), 1.0)
    pan(camera, 0.3, -0.2)
    np.testing.assert_allclose(place_of(camera, (0, 0, 0), 1.0) - before, [0.3, -0.2], atol=1e-9)
    centre_on(camera, (7.0, 8.0, 9.0))
    np.testing.assert_allclose(place_of(camera, (7, 8, 9), 1.0), 0.0, atol=1e-9)
    assert np.subtract(camera.position, camera.focal_point) == pytest.approx([0, -5, 0])


def test_turning_goes_around_what_is_looked_at():
    camera = stand(0.0, -5.0)
    turn(camera, 90.0, 0.0)
    np.testing.assert_allclose(np.subtract(camera.position, camera.focal_point), [5, 0, 0], atol=1e-9)
    turn(camera, 0.0, 30.0)
    assert camera.position[2] - camera.focal_point[2] == pytest.approx(2.5)
