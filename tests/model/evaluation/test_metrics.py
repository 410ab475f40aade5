"""Distances between shapes, against closed forms."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import trimesh

from naisr_model.errors import InputError
from naisr_model.evaluation import metrics
from naisr_model.evaluation.metrics import Distances, Pair, compare

RADIUS = 10.0
FEW = {"samples": 10_000, "emd_samples": 400}
GAPS = 0.12
"""The nearest of 10,000 samples lies beside the nearest point; a maximum can grow by this share."""


def sphere(radius: float, *, centre: tuple[float, float, float] = (0, 0, 0)) -> trimesh.Trimesh:
    mesh = trimesh.creation.icosphere(subdivisions=5, radius=radius)
    return mesh.apply_translation(centre)


def together(parts: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    mesh = trimesh.util.concatenate(parts) if parts else trimesh.Trimesh()
    assert isinstance(mesh, trimesh.Trimesh)
    return mesh


def test_concentric_spheres() -> None:
    found = compare(sphere(RADIUS), sphere(12.0), **FEW)
    assert found["cd_x100"] == pytest.approx(100 * 2 * 0.2**2, rel=0.02)
    assert 20.0 <= found["hd_x100"] <= 20.0 * (1 + GAPS)
    assert found["hd95_x100"] == pytest.approx(20.0, rel=0.03)
    assert 19.5 <= found["emd_x100"] <= 28
    assert found["mean_mm"] == pytest.approx(2.0, rel=0.01)
    assert found["vd_cm3"] == pytest.approx(4 / 3 * math.pi * (1.2**3 - 1), rel=0.005)


def test_shifted_spheres() -> None:
    shift = 2.0
    # Archimedes: the cosine towards the shift is uniform over a sphere, so means are integrals over it.
    cosine = np.linspace(-1, 1, 20_001)
    gap = np.abs(np.sqrt(RADIUS**2 + shift**2 - 2 * RADIUS * shift * cosine) - RADIUS)
    found = compare(sphere(RADIUS), sphere(RADIUS, centre=(0, shift, 0)), **FEW)
    assert found["cd_x100"] == pytest.approx(100 * 2 * np.mean(gap**2) / RADIUS**2, rel=0.05)
    assert found["mean_mm"] == pytest.approx(np.mean(gap), rel=0.05)
    assert 20.0 <= found["hd_x100"] <= 20.0 * (1 + GAPS)
    assert 19.5 <= found["emd_x100"] <= 28
    assert found["vd_cm3"] == pytest.approx(0, abs=1e-9)


def test_a_cube_and_a_taller_one() -> None:
    cube, taller = trimesh.creation.box(extents=(10, 10, 10)), trimesh.creation.box(extents=(10, 10, 12))
    found = compare(cube, taller, **FEW)
    corner = 5 * math.sqrt(3)
    assert 100 / corner <= found["hd_x100"] <= 100 / corner * (1 + GAPS)
    assert found["vd_cm3"] == pytest.approx(0.2)


def test_the_target_alone_sets_the_scale() -> None:
    forth, back = compare(sphere(10), sphere(20), **FEW), compare(sphere(20), sphere(10), **FEW)
    assert forth["hd_x100"] == pytest.approx(100, rel=0.02)
    assert back["hd_x100"] == pytest.approx(50, rel=0.02)


def test_scaled_numbers_do_not_depend_on_the_unit_of_length() -> None:
    small = compare(sphere(RADIUS), sphere(11), **FEW)
    large = compare(sphere(3 * RADIUS), sphere(33), **FEW)
    assert large["cd_x100"] == pytest.approx(small["cd_x100"])
    assert large["hd_x100"] == pytest.approx(small["hd_x100"])
    assert large["emd_x100"] == pytest.approx(small["emd_x100"])
    assert large["mean_mm"] == pytest.approx(3 * small["mean_mm"])
    assert large["vd_cm3"] == pytest.approx(27 * small["vd_cm3"])


def test_a_far_ghost_shows_in_the_hausdorff_distance_but_not_in_its_95th_percentile(
    ball: trimesh.Trimesh,
) -> None:
    ghost = trimesh.creation.icosphere(subdivisions=2, radius=1.0).apply_translation((30, 0, 0))
    found = compare(ball, together([ball, ghost]), **FEW)
    assert found["hd_x100"] == pytest.approx(100 * (31 - RADIUS) / RADIUS, rel=0.02)
    assert found["hd95_x100"] < 10


def test_one_surface_sampled_twice_is_at_the_distance_that_sampling_makes(ball: trimesh.Trimesh) -> None:
    found = compare(ball, ball, samples=20_000, emd_samples=50)
    assert found["cd_x100"] == pytest.approx(100 * 2 * (ball.area / RADIUS**2) / (math.pi * 20_000), rel=0.05)
    assert found["vd_cm3"] == 0


def test_the_seed_decides_the_samples(ball: trimesh.Trimesh) -> None:
    first, again, other = (compare(ball, ball, samples=500, emd_samples=50, seed=seed) for seed in (1, 1, 2))
    assert first == again
    assert first != other


def test_what_several_metrics_need_is_computed_once(ball: trimesh.Trimesh) -> None:
    pair = Pair(ball, ball, samples=100, emd_samples=40)
    assert pair.nearest is pair.nearest and pair.points is pair.points
    assert np.array_equal(pair.few_points[0], pair.points[0][:40])


def test_a_record_is_flat_and_comes_back(ball: trimesh.Trimesh) -> None:
    found = compare(ball, sphere(12.0), samples=300, emd_samples=40)
    record = found.to_json()
    names = ["cd_x100", "hd_x100", "hd95_x100", "emd_x100", "mean_mm", "vd_cm3", "samples", "emd_samples"]
    assert list(record) == names
    assert Distances.from_json(record) == found


def test_the_record_says_how_many_samples_there_were(ball: trimesh.Trimesh) -> None:
    found = compare(ball, ball, samples=300, emd_samples=40)
    assert (found.samples, found.emd_samples) == (300, 40)


def test_the_hausdorff_distance_alone_is_that_of_the_record() -> None:
    alone = metrics.HAUSDORFF.measure(Pair(sphere(10), sphere(12), samples=1000, emd_samples=10, seed=3))
    assert alone == compare(sphere(10), sphere(12), samples=1000, emd_samples=10, seed=3)["hd_x100"]


def test_nearest_neighbour_distances_of_points_on_a_line() -> None:
    here, there = np.array([[0.0, 0.0], [10.0, 0.0]]), np.array([[0.0, 1.0]])
    nearest = metrics.nearest_distances(here, there)
    forth, back = [1.0, math.sqrt(101)], [1.0]
    assert nearest.forth == pytest.approx(forth)
    assert nearest.back == pytest.approx(back)
    assert metrics.chamfer(nearest) == pytest.approx((1 + 101) / 2 + 1)
    assert metrics.mean_distance(nearest) == pytest.approx(((1 + math.sqrt(101)) / 2 + 1) / 2)
    assert metrics.hausdorff(nearest) == pytest.approx(math.sqrt(101))


def test_more_samples_bring_the_earth_movers_distance_closer() -> None:
    few, many = (compare(sphere(10), sphere(12), samples=10, emd_samples=n)["emd_x100"] for n in (100, 1600))
    assert 19.5 <= many <= 23.5
    assert many < few


def test_the_earth_movers_distance_is_the_best_of_all_assignments() -> None:
    rng = np.random.default_rng(0)
    here, there = rng.normal(size=(6, 3)), rng.normal(size=(6, 3))
    best = min(
        np.linalg.norm(here - there[list(order)], axis=1).mean() for order in itertools.permutations(range(6))
    )
    assert metrics.earth_movers(here, there) == pytest.approx(best)


def test_a_translation_costs_the_earth_mover_its_length() -> None:
    here = np.random.default_rng(1).normal(size=(200, 3))
    assert metrics.earth_movers(here, here + np.array([3, 4, 0])) == pytest.approx(5)


def test_the_scale_is_measured_from_the_centre_of_the_bounding_box() -> None:
    box = trimesh.creation.box(extents=(6, 8, 24)).apply_translation((100, -50, 3))
    assert metrics.unit_scale(box) == pytest.approx(13)


def test_vertices_that_no_face_uses_do_not_count() -> None:
    box = trimesh.creation.box(extents=(6, 8, 24))
    stray = trimesh.Trimesh(np.vstack([box.vertices, [[999, 0, 0]]]), box.faces, process=False)
    assert metrics.unit_scale(stray) == pytest.approx(13)


@pytest.mark.parametrize("count", [0, 1, 3])
def test_components(count: int) -> None:
    spheres = [sphere(1, centre=(4 * i, 0, 0)) for i in range(count)]
    assert metrics.component_count(together(spheres)) == count


def test_nothing_to_compare_is_said_in_words(ball: trimesh.Trimesh) -> None:
    for pair in [(ball, trimesh.Trimesh()), (trimesh.Trimesh(), ball)]:
        with pytest.raises(InputError, match="no surface"):
            compare(*pair)
