"""Surfaces of analytic fields and of the shipped atlases: the band against every node of the lattice."""

from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from scipy.spatial import cKDTree
from skimage.measure import marching_cubes

from naisr_model.atlas import Atlas
from naisr_model.checkpoint import load
from naisr_model.covariates import normalised_vector
from naisr_model.errors import Cancelled
from naisr_model.frames import Frame
from naisr_model.progress import Progress
from naisr_model.surface.fields import shape_field
from naisr_model.surface.isosurface import isosurface
from naisr_model.surface.lattice import Lattice
from naisr_model.surface.sparse import continued, evaluate_band, evaluate_everywhere

FRAME = Frame((10.0, 0.0, -5.0), 50.0)


def sphere(points):
    return np.linalg.norm(points - np.array([0.1, 0, 0], np.float32), axis=1) - np.float32(0.5)


def ball(points, centre, radius):
    return np.linalg.norm(points - np.array(centre, np.float32), axis=1) - np.float32(radius)


def thin_ring(points):
    """A tube of 0.03 box units, thinner than a coarse block, of slope 3 instead of 1."""
    around = np.hypot(points[:, 0], points[:, 1]) - 0.7
    return (3 * (np.hypot(around, points[:, 2]) - 0.03)).astype(np.float32)


def tilted_thread(points):
    """A straight tube thinner than a cell of 64^3, which falls apart there as it does at every node."""
    along = np.array([0.48, 0.6, 0.64], np.float32)
    offset = points - np.array([0.03, 0.02, 0.01], np.float32)
    across = offset - (offset @ along)[:, None] * along
    return np.maximum(np.linalg.norm(across, axis=1) - 0.02, np.abs(offset @ along) - 0.8).astype(np.float32)


def nearly_touching(points):
    """Two spheres with a gap of half a cell of 64^3."""
    return np.minimum(ball(points, [-0.31, 0, 0], 0.3), ball(points, [0.305, 0, 0], 0.3))


def speck(points):
    """A sphere of a cell's size at 64^3, in the middle of a coarse block."""
    return ball(points, [0.3125, -0.4375, 0.0625], 0.035)


def speck_at_a_face(points):
    return ball(points, [0.3125, -0.4375, 0.125], 0.035)


def steep(points):
    return 4 * sphere(points)


def cube(points):
    """Kinks on its diagonals, edges and corners; flat sides."""
    return np.abs(points - np.array([0.01, 0.02, 0.03], np.float32)).max(axis=1) - np.float32(0.4)


def shell(points):
    """Two nested surfaces half a coarse block apart."""
    return np.abs(sphere(points)) - np.float32(0.03)


def rippled(points):
    """A sphere with ripples that vanish at every node of the coarsest level."""
    return sphere(points) + np.float32(0.1) * np.sin(8 * np.pi * points[:, 0])


def needled(points):
    """A sphere with a needle out to the side of the box, between all nodes of coarser levels."""
    across = np.hypot(points[:, 1] - np.float32(0.03125), points[:, 2] - np.float32(0.03125))
    narrow = np.exp(-((across / 0.015) ** 2)) * (points[:, 0] > 0)
    return (sphere(points) * (1 - narrow) - 0.03 * narrow).astype(np.float32)


def filling(points):
    """Negative up to the sides of the box, but for a hole."""
    return -sphere(points)


FIELDS = [
    sphere,
    thin_ring,
    tilted_thread,
    nearly_touching,
    speck,
    speck_at_a_face,
    steep,
    cube,
    shell,
    rippled,
    needled,
    filling,
]


class Recording:
    """A field that keeps the points at which it was evaluated."""

    def __init__(self, field):
        self.field, self.batches = field, []

    def __call__(self, points):
        self.batches.append(points)
        return self.field(points)

    @property
    def points(self):
        return np.concatenate(self.batches)

    def strides(self, lattice):
        """The largest power of two that divides all node indices of a batch, one a batch."""
        indices = [np.rint((batch + 1) / lattice.spacing).astype(int) for batch in self.batches]
        return [int(np.gcd.reduce(batch, axis=None, initial=lattice.resolution)) for batch in indices]


def assert_same_mesh(field, lattice, guess=None):
    dense = isosurface(evaluate_everywhere(field, lattice), lattice, FRAME)
    banded = isosurface(evaluate_band(field, lattice, guess=guess), lattice, FRAME)
    assert len(dense.faces)
    assert dense.faces.tolist() == banded.faces.tolist()
    assert np.abs(dense.vertices - banded.vertices).max() < 1e-5 * 2 * FRAME.scale_mm


def test_another_library_finds_the_same_surface():
    lattice = Lattice(48)
    values = evaluate_everywhere(sphere, lattice)
    mesh = isosurface(values, lattice, FRAME)
    vertices, faces, *_ = marching_cubes(values, 0.0, spacing=(lattice.spacing,) * 3)
    there = FRAME.to_mm(vertices[:, ::-1] - 1)
    assert mesh.volume == pytest.approx(abs(trimesh.Trimesh(there, faces).volume), rel=1e-3)
    assert np.abs(cKDTree(there).query(mesh.vertices)[0]).max() < 1e-3


def test_a_sphere_is_where_it_should_be_and_faces_outward():
    lattice = Lattice(64)
    mesh = isosurface(evaluate_band(sphere, lattice), lattice, FRAME)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 25**3, rel=0.005)
    assert mesh.center_mass == pytest.approx([15, 0, -5], abs=0.05)
    distances = np.linalg.norm(mesh.vertices - [15, 0, -5], axis=1)
    assert distances == pytest.approx(25, abs=0.1)


@pytest.mark.parametrize("field", FIELDS)
@pytest.mark.parametrize("resolution", [32, 40, 64])
def test_the_band_gives_the_same_mesh_as_every_node(field, resolution):
    assert_same_mesh(field, Lattice(resolution))


@pytest.mark.parametrize("field", [thin_ring, speck, nearly_touching, rippled])
def test_more_levels_miss_nothing_either(field):
    assert_same_mesh(field, Lattice(128))


def test_the_band_is_found_in_the_plane_too():
    def circle(points):
        return np.linalg.norm(points, axis=1) - np.float32(0.5)

    lattice = Lattice(128, dim=2)
    band, everywhere = evaluate_band(circle, lattice), evaluate_everywhere(circle, lattice)
    evaluated = np.isfinite(band)
    assert ((band < 0) == (everywhere < 0)).all()
    assert (band == everywhere)[evaluated].all() and (everywhere[~evaluated] ** 2 > lattice.spacing**2).all()
    assert evaluated.mean() < 0.15


@pytest.mark.parametrize("atlas", ["airway", "bodies"])
@pytest.mark.parametrize("corner", [0, 1], ids=["least", "most"])
def test_nothing_is_missed_at_the_corners_of_a_shipped_atlas(atlas, corner):
    checkpoint = load(Path(__file__).parents[3] / "resources" / f"{atlas}.safetensors")
    extremes = [(c.range[corner] - c.centre) / c.scale for c in checkpoint.population.covariates]
    latent = torch.as_tensor(checkpoint.latents[3])
    assert_same_mesh(shape_field(checkpoint.model(), torch.tensor(extremes), latent), Lattice(48))


@pytest.mark.parametrize("name", ["airway", "bodies"])
def test_a_tracker_misses_nothing_of_a_shipped_atlas(name):
    atlas = Atlas.load(Path(__file__).parents[3] / "resources" / f"{name}.safetensors")
    template, network = atlas.template(128), atlas.checkpoint.model()
    tracker = atlas.tracker(template, atlas.tabulate(template))
    latent = torch.zeros(atlas.checkpoint.preset.network.latent)
    low, high = np.array([c.range for c in atlas.covariates]).T
    for place in (low, np.random.default_rng(0).uniform(low, high)):
        values = dict(zip(atlas.population.names, place.tolist(), strict=True))
        vector = torch.tensor(normalised_vector(atlas.covariates, values)).float()
        assert_same_mesh(shape_field(network, vector, latent), Lattice(48), tracker.guess(values))


def test_no_point_is_evaluated_twice_and_few_are_evaluated_at_all():
    counts = []
    for resolution in (64, 128, 256):
        recording = Recording(sphere)
        evaluate_band(recording, Lattice(resolution))
        assert len(np.unique(recording.points, axis=0)) == len(recording.points)
        counts.append(len(recording.points))
    assert counts[1] < 129**3 / 25 and counts[2] < 257**3 / 60
    assert np.log2(counts[2] / counts[0]) / 2 < 2.2


def two_balls(points):
    return np.minimum(ball(points, [-0.4, 0, 0], 0.35), ball(points, [0.45, 0.1, 0], 0.3))


def ball_with_speck(points):
    return np.minimum(ball(points, [-0.4, 0, 0], 0.35), ball(points, [0.6, 0.4, 0.3], 0.04))


def slightly_off(field):
    """By up to a fifth of a cell of 64^3, now here, now there."""
    return lambda points: field(points) + np.float32(0.006) * np.sin(9 * points).prod(axis=1)


@pytest.mark.parametrize("field", FIELDS)
def test_a_guess_saves_evaluations_and_changes_nothing(field):
    lattice = Lattice(64)
    counts = []
    for guess in (None, slightly_off(field)):
        recording = Recording(field)
        evaluate_band(recording, lattice, guess=guess)
        assert len(np.unique(recording.points, axis=0)) == len(recording.points)
        counts.append(len(recording.points))
    assert counts[1] < 0.6 * counts[0]
    assert_same_mesh(field, lattice, slightly_off(field))


WRONG_GUESSES = {
    "elsewhere by voxels": lambda points: two_balls(points + np.float32(0.1)),
    "one component": lambda points: ball(points, [-0.4, 0, 0], 0.35),
    "one component too many": lambda points: np.minimum(two_balls(points), ball(points, [0, 0.7, 0], 0.1)),
    "components joined": lambda points: two_balls(points) - np.float32(0.1),
    "nothing": lambda points: np.full(len(points), 9, np.float32),
    "everything": lambda points: np.full(len(points), -9, np.float32),
    "inside out": lambda points: -two_balls(points),
    "half as steep": lambda points: two_balls(points) / 2,
}


@pytest.mark.parametrize("guess", WRONG_GUESSES.values(), ids=WRONG_GUESSES)
def test_a_wrong_guess_does_not_change_the_mesh(guess):
    for field in (two_balls, ball_with_speck, shell):
        assert_same_mesh(field, Lattice(64), guess)


def test_a_guess_that_errs_in_one_place_is_trusted_less_everywhere():
    """A dent deeper than a cell, which no probe meets."""

    def dented(points):
        across = np.linalg.norm(points - np.array([0.1, 0.03, 0.5], np.float32), axis=1)
        return (sphere(points) + 1.2 / 32 * np.exp(-((across / 0.05) ** 2))).astype(np.float32)

    lattice = Lattice(64)
    counts = []
    for guess in (sphere, dented, None):
        recording = Recording(sphere)
        evaluate_band(recording, lattice, guess=guess)
        counts.append(len(recording.points))
    assert 1.2 * counts[0] < counts[1] < 0.9 * counts[2]
    assert_same_mesh(sphere, lattice, dented)
    assert_same_mesh(dented, lattice, sphere)


def test_a_bound_that_is_broken_on_the_way_is_widened():
    lattice = Lattice(64)
    for field, widened in ((sphere, False), (rippled, True)):
        recording = Recording(field)
        evaluate_band(recording, lattice)
        strides = recording.strides(lattice)
        assert strides[0] == 4 and min(strides) == 1
        # Coarser levels are gone through again only after a finer one broke the bound.
        assert (strides != sorted(strides, reverse=True)) == widened
        assert len(recording.points) < 65**3


def test_between_evaluated_nodes_a_field_is_continued():
    def plane(points):
        return (points @ np.array([0.6, 0.8, 0]) - 0.1).astype(np.float32)

    lattice = Lattice(64)
    for field, tolerance in ((plane, 1e-6), (sphere, lattice.spacing)):
        everywhere = evaluate_everywhere(field, lattice)
        found = continued(evaluate_band(field, lattice), lattice)
        assert np.abs(found - everywhere).max() < tolerance
    near = np.abs(everywhere) < lattice.spacing / 2
    np.testing.assert_array_equal(found[near], everywhere[near])


def test_the_surface_is_followed_out_of_what_was_evaluated():
    """Threads through a ball run into blocks that were left out, whose own bounds nothing has broken."""
    rng = np.random.default_rng(175)
    places, widths, depths = (
        rng.uniform(-0.6, 0.6, (6, 3)),
        rng.uniform(0.02, 0.12, 6),
        rng.uniform(-0.3, 0.3, 6),
    )

    def threaded(points):
        values = np.linalg.norm(points, axis=1) - 0.5
        for place, width, depth in zip(places, widths, depths, strict=True):
            across = np.hypot(*(points - place)[:, :2].T)
            values = values + depth * np.exp(-((across / width) ** 2))
        return values.astype(np.float32)

    assert_same_mesh(threaded, Lattice(64))


def test_no_surface_is_an_empty_mesh():
    lattice = Lattice(16)
    assert len(isosurface(evaluate_band(lambda p: sphere(p) + 9, lattice), lattice, FRAME).faces) == 0


def test_cancel_is_polled_and_progress_ends_at_one():
    with pytest.raises(Cancelled):
        evaluate_band(sphere, Lattice(64), Progress(is_unwanted=lambda: True))
    told: list[float] = []
    evaluate_band(sphere, Lattice(64), Progress(told.append))
    assert told[-1] == 1 and told == sorted(told)


def test_lattice_nodes_run_x_fastest_and_fill_the_box():
    points = Lattice(16).points(Lattice(16).nodes())
    assert points[0] == pytest.approx([-1, -1, -1]) and points[-1] == pytest.approx([1, 1, 1])
    assert points[1] - points[0] == pytest.approx([0.125, 0, 0])
