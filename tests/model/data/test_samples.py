"""Signed distances against closed formulas: sphere, capsule, torus."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from naisr_model.data.samples import sample_shape, signed_distance
from naisr_model.frames import Frame

Distance = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def sphere_distance(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.linalg.norm(points, axis=1) - 0.5


def capsule_distance(points: NDArray[np.float64]) -> NDArray[np.float64]:
    along = np.clip(points[:, 2], -0.5, 0.5)
    return np.hypot(np.hypot(points[:, 0], points[:, 1]), points[:, 2] - along) - 0.1


def torus_distance(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.hypot(np.hypot(points[:, 0], points[:, 1]) - 0.6, points[:, 2]) - 0.15


def capsule_mesh() -> trimesh.Trimesh:
    mesh = trimesh.creation.capsule(height=1.0, radius=0.1, count=[96, 96])
    mesh.apply_translation(-mesh.bounds.mean(axis=0))
    return mesh


SHAPES: dict[str, tuple[Callable[[], trimesh.Trimesh], Distance]] = {
    "sphere": (lambda: trimesh.creation.icosphere(5, radius=0.5), sphere_distance),
    "capsule": (capsule_mesh, capsule_distance),
    "torus": (lambda: trimesh.creation.torus(0.6, 0.15, 160, 96), torus_distance),
}
FACETS = 5e-4
"""How far these fine meshes stay from the smooth surfaces they stand for."""


def mixed_points(distance: Distance, count: int = 30_000) -> NDArray[np.float64]:
    """Points all over the box with the shell around the surface well covered."""
    points = np.random.default_rng(1).uniform(-1, 1, (10 * count, 3))
    near = points[np.abs(distance(points)) < 0.1]
    return np.vstack([points[:count], near[:count]])


@pytest.mark.parametrize("name", SHAPES)
def test_signed_distance_follows_the_formula(name):
    make, distance = SHAPES[name]
    points = mixed_points(distance)
    np.testing.assert_allclose(signed_distance(make(), points), distance(points), atol=FACETS)


@pytest.mark.parametrize("name", SHAPES)
def test_signs_survive_missing_faces(name):
    make, distance = SHAPES[name]
    mesh = make()
    mesh.update_faces(np.random.default_rng(2).random(len(mesh.faces)) > 0.01)
    points = mixed_points(distance)
    truth, found = distance(points), signed_distance(mesh, points)
    clear = np.abs(truth) > FACETS
    assert (np.sign(found) != np.sign(truth))[clear].mean() < 1e-4


def test_signs_survive_a_hole():
    mesh = trimesh.creation.icosphere(5, radius=0.5)
    hole = np.argsort(mesh.triangles_center[:, 2])[-200:]
    mesh.update_faces(~np.isin(np.arange(len(mesh.faces)), hole))
    points = mixed_points(sphere_distance)
    truth, found = sphere_distance(points), signed_distance(mesh, points)
    clear = np.abs(truth) > FACETS
    assert (np.sign(found) != np.sign(truth))[clear].mean() < 1e-3


@pytest.fixture(scope="module")
def frame() -> Frame:
    return Frame((10.0, -20.0, 30.0), 50.0)


@pytest.fixture(scope="module")
def torus_mm(frame) -> trimesh.Trimesh:
    mesh = SHAPES["torus"][0]()
    return trimesh.Trimesh(frame.to_mm(mesh.vertices), mesh.faces, process=False)


def test_samples_are_in_model_units_with_outward_normals(torus_mm, frame):
    taken = sample_shape(torus_mm, frame, 5000, 8000, 3000, seed=0)
    assert [a.shape for a in (taken.surface, taken.near, taken.uniform)] == [(5000, 6), (8000, 4), (3000, 4)]
    assert {a.dtype for a in (taken.surface, taken.near, taken.uniform)} == {np.dtype(np.float32)}
    points, normals = np.split(taken.surface.astype(np.float64), 2, axis=1)
    np.testing.assert_allclose(torus_distance(points), 0, atol=FACETS)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-5)
    gradient = (torus_distance(points + 1e-3 * normals) - torus_distance(points - 1e-3 * normals)) / 2e-3
    assert gradient.min() > 0.99
    for samples in (taken.near, taken.uniform):
        exact = samples.astype(np.float64)
        np.testing.assert_allclose(exact[:, 3], torus_distance(exact[:, :3]), atol=FACETS)


def test_near_samples_hug_the_surface_and_uniform_ones_fill_the_box(torus_mm, frame):
    taken = sample_shape(torus_mm, frame, 10, 8000, 8000, seed=0)
    assert np.abs(taken.near[:, 3]).mean() < 0.04
    assert (taken.near[:, 3] < 0).mean() == pytest.approx(0.5, abs=0.05)
    assert np.abs(taken.uniform[:, :3]).max() <= 1
    np.testing.assert_allclose(taken.uniform[:, :3].mean(axis=0), 0, atol=0.03)
    np.testing.assert_allclose(taken.uniform[:, :3].std(axis=0), 3**-0.5, atol=0.02)


def test_surface_samples_are_spread_evenly_by_area():
    box = trimesh.creation.box((1.0, 1.0, 0.25))
    points = sample_shape(box, Frame((0.0, 0.0, 0.0), 1.0), 40_000, 1, 1, seed=3).surface[:, :3]
    on_top = np.abs(np.abs(points[:, 2]) - 0.125) < 1e-6
    assert on_top.mean() == pytest.approx(2 / 3, abs=0.01)
    np.testing.assert_allclose(points[on_top, :2].std(axis=0), 12**-0.5, atol=0.005)


def test_a_part_of_the_samples_is_as_mixed_as_the_whole(torus_mm, frame):
    near = sample_shape(torus_mm, frame, 10, 20_000, 10, seed=0).near
    spreads = [block[:, 3].std() for block in np.split(near, 20)]
    assert np.ptp(spreads) < 0.2 * np.mean(spreads)


def test_the_seed_decides(torus_mm, frame):
    first, again, other = (sample_shape(torus_mm, frame, 50, 50, 50, seed=s) for s in (1, 1, 2))
    np.testing.assert_array_equal(first.near, again.near)
    assert not np.array_equal(first.near, other.near)
