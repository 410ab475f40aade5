"""Tabulated displacements and the template carried by them, against the networks themselves."""

from __future__ import annotations

from pathlib import Path

import igl
import numpy as np
import pytest
import torch
import trimesh

from naisr_model.atlas import Atlas
from naisr_model.errors import Cancelled, InputError
from naisr_model.learning.fitting import prior
from naisr_model.models.base import deformable
from naisr_model.progress import Progress
from naisr_model.surface.displacements import SPACINGS, TOLERANCE, Displacements, DisplacementTables, sample
from naisr_model.surface.fields import shape_field
from naisr_model.surface.lattice import Lattice
from naisr_model.surface.sparse import evaluate_band
from naisr_model.surface.tracking import RESOLVED, CodeTracker, FadingTracker, Tracked, Tracker

VOXEL = 2 / 128

OUTSTANDING = 8.0
"""As many times a training code: some voxels from the average."""


@pytest.fixture(scope="module")
def atlas(egg_atlas: Path) -> Atlas:
    return Atlas.load(egg_atlas)


@pytest.fixture(scope="module")
def template(atlas: Atlas) -> trimesh.Trimesh:
    return atlas.template(128)


@pytest.fixture(scope="module")
def tables(atlas: Atlas, template: trimesh.Trimesh) -> DisplacementTables:
    return atlas.tabulate(template)


@pytest.fixture(scope="module")
def tracker(atlas: Atlas, template: trimesh.Trimesh, tables: DisplacementTables) -> Tracker:
    return atlas.tracker(template, tables)


def exact_displacement(atlas: Atlas, vector: list[float], points: np.ndarray) -> np.ndarray:
    latent = torch.zeros(atlas.checkpoint.preset.network.latent)
    model = deformable(atlas.checkpoint.model())
    located = torch.as_tensor(points, dtype=torch.float32)[None]
    with torch.inference_mode():
        return model.displacement(located, torch.tensor([vector]), latent[None])[0].numpy()


def test_tables_agree_with_the_networks_between_nodes_and_knots(atlas, tables):
    rng = np.random.default_rng(1)
    points = rng.uniform(tables.region[0], tables.region[1], (500, 3))
    displacements = Displacements(tables)
    for vector in rng.uniform([-1.6, -1.0], [1.6, 1.0], (10, 2)).tolist():
        found = sample(displacements.at(vector), displacements.lower, torch.as_tensor(points.T).float())
        error = np.linalg.norm(found.numpy().T - exact_displacement(atlas, vector, points), axis=1)
        assert error.max() < 2 * TOLERANCE * np.sqrt(3)
        assert error.mean() < 0.25 * VOXEL


def test_a_linear_field_is_tabulated_exactly():
    region = np.array([[-0.5, -0.3, -0.1], [0.4, 0.3, 0.2]])
    displacements = Displacements(DisplacementTables(region, ()))
    z, y, x = torch.meshgrid(*(torch.arange(n) * SPACINGS[-1] for n in (5, 6, 7)), indexing="ij")
    field = torch.stack([x + 2 * y - z])
    points = torch.tensor([[0.03, 0.1, 0.15], [0.01, 0.05, 0.12], [0.02, 0.07, 0.11]])
    found = sample(field, displacements.lower, points + displacements.lower[:, None])
    torch.testing.assert_close(found[0], points[0] + 2 * points[1] - points[2])


def test_at_the_centre_nothing_moves(tracker, template, atlas):
    tracked = tracker.track({})
    np.testing.assert_allclose(tracked.points_mm, template.vertices, atol=1e-3)
    assert tracked.is_trustworthy


@pytest.mark.parametrize("values", [{"age": 1.2}, {"age": 8.8, "sex": 1.0}, {"sex": -1.0}])
def test_every_vertex_stands_on_the_shape_and_knows_its_point_of_the_template(
    atlas, template, tracker, values
):
    tracked = tracker.track(values)
    assert tracked.is_trustworthy
    scale_mm = atlas.frame.scale_mm
    assert np.abs(atlas.sdf(tracked.points_mm, values)).max() < 1.0 * VOXEL * scale_mm
    vector = [float(c.normalise(values.get(c.name, c.centre))) for c in atlas.covariates]
    points = atlas.frame.to_model(tracked.points_mm)
    landed_mm = atlas.frame.to_mm(points + exact_displacement(atlas, vector, points))
    off_mm = np.linalg.norm(landed_mm - template.vertices, axis=1)
    assert off_mm.max() < (2 * TOLERANCE * np.sqrt(3) + RESOLVED) * scale_mm


def test_the_carried_surface_is_the_exact_one(atlas, tracker):
    values = {"age": 7.5, "sex": 0.5}
    tracked, exact = tracker.track(values), atlas.shape(values)
    carried = trimesh.Trimesh(tracked.points_mm, tracker.faces, process=False)
    assert carried.volume == pytest.approx(exact.volume, rel=0.01)
    squared_mm2, triangles, _ = igl.point_mesh_squared_distance(
        tracked.points_mm.astype(float), exact.vertices, np.asarray(exact.faces)
    )
    assert np.sqrt(squared_mm2).mean() < 0.25 * VOXEL * atlas.frame.scale_mm
    cosines = np.sum(exact.face_normals[triangles] * tracked.normals, axis=1)
    assert np.median(cosines) > 0.99


@pytest.mark.parametrize("values", [{}, {"age": 1.2}, {"age": 8.8, "sex": 1.0}])
def test_the_guess_is_the_field_near_the_surface(atlas, tracker, values):
    vertices_mm = atlas.shape(values).vertices
    points = atlas.frame.to_model(vertices_mm).astype(np.float32)
    assert np.abs(tracker.guess(values)(points)).max() < 0.5 * VOXEL


def test_a_tracker_saves_evaluations_and_changes_nothing(atlas, tracker):
    values, lattice = {"age": 8.0, "sex": 0.5}, Lattice(128)
    vector = torch.tensor([float(c.normalise(values[c.name])) for c in atlas.covariates])
    field = shape_field(atlas.checkpoint.model(), vector, torch.zeros(atlas.checkpoint.preset.network.latent))
    counts = []

    def counting(points):
        counts.append(len(points))
        return field(points)

    evaluate_band(counting, lattice)
    without = sum(counts)
    counts.clear()
    evaluate_band(counting, lattice, guess=tracker.guess(values))
    assert sum(counts) < without / 2


@pytest.mark.parametrize("latent", [0.0, 0.3], ids=["own code", "another code"])
def test_surfaces_are_the_same_with_and_without_a_tracker(atlas, tracker, latent):
    code = np.full(atlas.checkpoint.preset.network.latent, latent)
    for one, other in (
        [atlas.shape({"age": 2.5, "sex": -1.0}, code, 64, tracker=each) for each in (None, tracker)],
        [atlas.effect("age", 9.5, code, 64, extrapolate=True, tracker=each) for each in (None, tracker)],
    ):
        assert one.faces.tolist() == other.faces.tolist()
        assert np.abs(one.vertices - other.vertices).max() < 1e-5 * 2 * atlas.frame.scale_mm


@pytest.fixture(scope="module")
def outstanding(atlas: Atlas, template: trimesh.Trimesh) -> CodeTracker:
    code = OUTSTANDING * atlas.checkpoint.latents[0]
    return atlas.tracker(template, atlas.tabulate(template, code))


@pytest.mark.parametrize("share", [0.0, 0.001, 0.4, 1.0])
def test_between_two_codes_stands_the_surface_of_the_code_between(atlas, tracker, outstanding, share):
    values = {"age": 7.5, "sex": 1.0}
    fading = FadingTracker(tracker, outstanding, lambda _: share)
    code = share * OUTSTANDING * atlas.checkpoint.latents[0]
    exact, tracked = atlas.shape(values, code, 128), fading.track(values)
    assert off_mm(tracked, exact) < 0.25 * VOXEL * atlas.frame.scale_mm
    assert np.linalg.norm(tracked.normals, axis=1) == pytest.approx(1, abs=1e-5)
    assert tracked.is_trustworthy
    faster = atlas.shape(values, code, 128, tracker=fading)
    assert faster.faces.tolist() == exact.faces.tolist()
    away_mm = np.abs(outstanding.track(values).points_mm - tracker.track(values).points_mm).max()
    assert away_mm > VOXEL * atlas.frame.scale_mm  # or there would be nothing between


def test_a_fitted_person_is_carried_elsewhere(atlas, template, monkeypatch):
    monkeypatch.setattr(prior, "UNSEEN_LASTING", 0.3)
    atlas = Atlas(atlas.checkpoint)  # which has not looked at its codes yet
    home, elsewhere = {"age": 6.5, "sex": 1.0}, {"age": 3.0, "sex": -1.0}
    fit = atlas.fit(atlas.shape(home, OUTSTANDING * atlas.checkpoint.latents[0], 64), home)
    told: list[float] = []
    tracker = fit.individual.tracker(template, progress=Progress(told.append))
    assert told == sorted(told) and told[-1] == 1
    assert tracker.nearness(home) == 1 and tracker.nearness(elsewhere) < 0.01
    for values in (home, elsewhere):
        exact, other = (
            atlas.shape(values, share * fit.latent) for share in ((1.0, 0.3), (0.3, 1.0))[values != home]
        )
        tracked = tracker.track(values)
        assert off_mm(tracked, exact) < 0.1 * VOXEL * atlas.frame.scale_mm < 0.5 * off_mm(tracked, other)


def off_mm(tracked: Tracked, exact: trimesh.Trimesh) -> float:
    """Mean distance of the carried vertices to a surface."""
    points, faces = tracked.points_mm.astype(float), np.asarray(exact.faces)
    return float(np.sqrt(igl.point_mesh_squared_distance(points, exact.vertices, faces)[0]).mean())


def test_where_it_starts_does_not_matter(tracker):
    cold = tracker.track({"age": 8.0, "sex": 1.0})
    warm = tracker.track({"age": 8.0, "sex": 1.0}, tracker.track({"age": 1.5}))
    np.testing.assert_allclose(warm.points_mm, cold.points_mm, atol=0.05)


def test_a_deformation_that_folds_is_told(atlas, template, tables):
    folded = DisplacementTables(
        tables.region, tuple(type(t)(t.spacing, t.knots, 30 * t.nodes) for t in tables.tables)
    )
    assert not atlas.tracker(template, folded).track({"age": 8.8, "sex": 1.0}).is_trustworthy


def test_values_outside_the_observed_range_are_refused(tracker):
    with pytest.raises(InputError, match="age"):
        tracker.track({"age": 500.0})


def test_tables_survive_the_disk(tables, tmp_path):
    tables.save(tmp_path / "tables.safetensors")
    again = DisplacementTables.load(tmp_path / "tables.safetensors")
    vector = [0.7, -0.4]
    torch.testing.assert_close(Displacements(again).at(vector), Displacements(tables).at(vector))


@pytest.mark.parametrize("content", [b"", b"something else", None])
def test_a_file_of_something_else_is_refused(tmp_path, content):
    path = tmp_path / "tables.safetensors"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match="tabulated"):
        DisplacementTables.load(path)


def test_tabulating_can_be_cancelled_and_reports_progress(atlas, template):
    seen: list[float] = []
    with pytest.raises(Cancelled):
        atlas.tabulate(template, progress=Progress(seen.append, lambda: bool(seen)))
    assert len(seen) == 1
