"""Sections against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from naisr_model.surface.sections import section

TILTED = np.array([0.36, -0.48, 0.8])


def cut(mesh: trimesh.Trimesh, normal, offset_mm: float):
    return section(mesh.vertices, mesh.faces, normal, offset_mm)


@pytest.mark.parametrize("offset_mm", [-7.0, 0.0, 3.0, 9.5])
def test_a_sphere_is_cut_in_a_circle(offset_mm):
    ball = trimesh.creation.icosphere(subdivisions=5, radius=10.0)
    found = cut(ball, TILTED, offset_mm)
    assert found.area_mm2 == pytest.approx(np.pi * (100 - offset_mm**2), rel=0.01)
    np.testing.assert_allclose(found.points_mm @ TILTED, offset_mm, atol=1e-9)


@pytest.mark.parametrize("normal", [(1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0), TILTED])
def test_an_ellipsoid_is_cut_in_an_ellipse(normal):
    """pi a b c (1 - d^2 / m^2) / m with m^2 = (a n1)^2 + (b n2)^2 + (c n3)^2."""
    axes, offset_mm = np.array([20.0, 12.0, 45.0]), 6.0
    egg = trimesh.creation.icosphere(subdivisions=5)
    egg.vertices *= axes
    reach = np.linalg.norm(axes * normal)
    expected = np.pi * axes.prod() * (1 - (offset_mm / reach) ** 2) / reach
    assert cut(egg, normal, offset_mm).area_mm2 == pytest.approx(expected, rel=0.005)


def test_a_plane_through_the_vertices_of_a_box_cuts_it_exactly():
    box = trimesh.creation.box((2.0, 3.0, 4.0))
    assert cut(box, (0, 0, 1.0), 2.0).area_mm2 == pytest.approx(6.0)
    diagonal = np.array([3.0, -2.0, 0.0]) / np.sqrt(13)
    assert cut(box, diagonal, 0.0).area_mm2 == pytest.approx(4 * np.sqrt(13))


def test_an_inner_wall_is_a_hole_and_two_parts_add_up():
    outer, inner = trimesh.creation.box((4.0, 4, 4)), trimesh.creation.box((2.0, 2, 2))
    inner.invert()
    other = trimesh.creation.box((1.0, 1, 1)).apply_translation((9, 0, 0))
    assert cut(outer + inner + other, (0, 0, 1.0), 0.1).area_mm2 == pytest.approx(16 - 4 + 1)


def test_an_open_surface_has_no_area_and_one_that_is_missed_has_none_at_all():
    ball = trimesh.creation.icosphere(subdivisions=2)
    open_ball = trimesh.Trimesh(ball.vertices, ball.faces[ball.triangles_center[:, 0] < 0.8], process=False)
    assert cut(open_ball, (0, 0, 1.0), 0.0).area_mm2 is None
    missed = cut(ball, (0, 0, 1.0), 2.0)
    assert missed.area_mm2 == 0.0 and len(missed.lines) == 0
    nothing = section(np.zeros((5, 3)), np.zeros((0, 3)), (0, 0, 1.0), 0.0)
    assert len(nothing.points_mm) == 0
