"""Volumes against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from naisr_model.surface.volume import enclosed_volume


def smooth(mesh: trimesh.Trimesh) -> float:
    return enclosed_volume(mesh.vertices, mesh.vertex_normals, mesh.faces)


@pytest.mark.parametrize(("subdivisions", "worst"), [(2, 1e-3), (3, 1e-4), (4, 1e-5)])
def test_a_ball(subdivisions, worst):
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=10)
    truth = 4 / 3 * np.pi * 1000
    assert smooth(mesh) == pytest.approx(truth, rel=worst)
    assert abs(mesh.volume / truth - 1) > 20 * worst


def test_a_torus_which_is_curved_both_ways():
    mesh = trimesh.creation.torus(10, 3, major_sections=48, minor_sections=16)
    truth = 2 * np.pi**2 * 10 * 9
    assert smooth(mesh) == pytest.approx(truth, rel=2e-3)
    assert mesh.volume < 0.98 * truth


def test_where_it_lies_does_not_matter():
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=10)
    here = smooth(mesh)
    mesh.apply_translation([300, -200, 50])
    assert smooth(mesh) == pytest.approx(here, rel=1e-9)
