"""Surfaces of analytic fields, and the band against every node of the lattice."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree
from skimage.measure import marching_cubes

from naisr_model.errors import Cancelled
from naisr_model.frames import Frame
from naisr_model.surface.isosurface import isosurface
from naisr_model.surface.lattice import Lattice
from naisr_model.surface.sparse import evaluate_band, evaluate_everywhere

FRAME = Frame((10.0, 0.0, -5.0), 50.0)


def sphere(points):
    return np.linalg.norm(points - np.array([0.1, 0, 0], np.float32), axis=1) - np.float32(0.5)


def thin_ring(points):
    """A tube of 0.03 box units, thinner than a coarse block, of slope 3 instead of 1."""
    around = np.hypot(points[:, 0], points[:, 1]) - 0.7
    return (3 * (np.hypot(around, points[:, 2]) - 0.03)).astype(np.float32)


def test_another_library_finds_the_same_surface():
    lattice = Lattice(48)
    values = evaluate_everywhere(sphere, lattice)
    mesh = isosurface(values, lattice, FRAME)
    vertices, faces, *_ = marching_cubes(values, 0.0, spacing=(lattice.spacing,) * 3)
    there = FRAME.to_mm(vertices[:, ::-1] - 1)
    assert mesh.volume == pytest.approx(abs(trimesh.Trimesh(there, faces).volume), rel=1e-3)
    assert np.abs(cKDTree(there).query(mesh.vertices)[0]).max() < 1e-3


class Counting:
    def __init__(self, field):
        self.field, self.points = field, 0

    def __call__(self, points):
        self.points += len(points)
        return self.field(points)


def test_a_sphere_is_where_it_should_be_and_faces_outward():
    lattice = Lattice(64)
    mesh = isosurface(evaluate_band(sphere, lattice), lattice, FRAME)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 25**3, rel=0.005)
    assert mesh.center_mass == pytest.approx([15, 0, -5], abs=0.05)
    distances = np.linalg.norm(mesh.vertices - [15, 0, -5], axis=1)
    assert distances == pytest.approx(25, abs=0.1)


@pytest.mark.parametrize("field", [sphere, thin_ring])
@pytest.mark.parametrize("resolution", [32, 64])
def test_the_band_gives_the_same_mesh_as_every_node(field, resolution):
    lattice = Lattice(resolution)
    dense = isosurface(evaluate_everywhere(field, lattice), lattice, FRAME)
    banded = isosurface(evaluate_band(field, lattice), lattice, FRAME)
    assert (dense.faces == banded.faces).all()
    assert np.abs(dense.vertices - banded.vertices).max() < 1e-6


def test_the_band_is_a_small_part_of_the_lattice():
    counting = Counting(sphere)
    evaluate_band(counting, Lattice(128))
    assert counting.points < 0.1 * 129**3


def test_no_surface_is_an_empty_mesh():
    lattice = Lattice(16)
    assert len(isosurface(evaluate_band(lambda p: sphere(p) + 9, lattice), lattice, FRAME).faces) == 0


def test_cancel_is_polled_and_progress_ends_at_one():
    with pytest.raises(Cancelled):
        evaluate_band(sphere, Lattice(64), should_stop=lambda: True)
    told: list[float] = []
    evaluate_band(sphere, Lattice(64), progress=told.append)
    assert told[-1] == 1 and told == sorted(told)


def test_lattice_nodes_run_x_fastest_and_fill_the_box():
    points = Lattice(16).points(Lattice(16).nodes())
    assert points[0] == pytest.approx([-1, -1, -1]) and points[-1] == pytest.approx([1, 1, 1])
    assert points[1] - points[0] == pytest.approx([0.125, 0, 0])
