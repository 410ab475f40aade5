"""A patient's way through the engine, with an atlas that was really trained."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from eggs import egg

from naisr_model.atlas import Atlas
from naisr_model.errors import Cancelled, InputError
from naisr_model.learning.fitting import prior
from naisr_model.progress import Progress
from naisr_viewer.engine.clinic import SHOWN_POINTS, Clinic
from naisr_viewer.engine.engine import Engine
from naisr_viewer.engine.surfaces import rounded
from naisr_viewer.panels.kinds import request_for
from naisr_viewer.state.explorer import ExplorerState, opened, with_patient, with_value
from naisr_viewer.state.layouts import FULL_SHAPE, Panel
from naisr_viewer.state.patients import OpenScan, Reading

CHANGE = Panel("change")
SCAN = Panel("scan")

KNOWN = (("age", 6.0), ("sex", 1.0))


def test_a_scan_is_read_as_it_is(desk):
    scan = desk[2].shown.scan
    assert scan.source.startswith("s25.stl") and not scan.blocked
    assert scan.extent == pytest.approx(egg(6.0, 1.0).volume / 1000, rel=1e-6)
    assert scan.normals.shape == scan.points_mm.shape


def test_the_fit_is_that_of_python(desk, egg_atlas, file):
    fit, expected = desk[2].fit, Atlas.load(egg_atlas).fit(trimesh.load_mesh(file), dict(KNOWN))
    assert dict(fit.values) == pytest.approx(expected.covariates) and fit.intervals == ()
    assert fit.residual_mm == pytest.approx(expected.residual_mm, rel=0.1)
    low, high = expected.volume_interval_cm3
    assert fit.extent == pytest.approx(expected.extent, rel=1e-3)
    assert fit.extent_margin == pytest.approx((high - low) / 2, rel=0.05)


def test_elsewhere_only_what_lasts_of_a_patient_is_shown(egg_atlas, tmp_path, monkeypatch):
    monkeypatch.setattr(prior, "UNSEEN_LASTING", 0.3)
    atlas, file = Atlas.load(egg_atlas), tmp_path / "outstanding.stl"
    atlas.shape(dict(KNOWN), 8 * atlas.checkpoint.latents[0], 64).export(file)
    engine = Engine(folder=tmp_path / "cache")
    clinic, state = Clinic(engine), opened(ExplorerState(), engine.open(egg_atlas))
    reading = Reading(file)
    scan = clinic.read(egg_atlas, reading, KNOWN)
    fit, _ = clinic.fit(egg_atlas, scan, KNOWN)
    state = with_patient(state, OpenScan(1, file.name, reading, scan, KNOWN, fit))
    elsewhere = with_value(state, "age", 3.0)
    assert fit.lasting == 0.3
    person = atlas.fit(trimesh.load_mesh(file), dict(KNOWN)).at({"age": 3.0})
    values = dict(elsewhere.named)
    kept, whole = (atlas.shape(values, share * person.latent).volume / 1000 for share in (1, 1 / 0.3))
    shown = engine.surface(request_for(elsewhere, FULL_SHAPE, 128))
    assert shown.extent == pytest.approx(kept, rel=2e-3) and abs(whole / kept - 1) > 5e-3
    low, high = person.volume_interval_cm3
    assert shown.extent_margin == pytest.approx((high - low) / 2, rel=0.05)
    colouring = engine.surface(request_for(elsewhere, SCAN, 128)).colouring
    assert colouring is not None
    off_mm, whole_off_mm = (
        np.abs(colouring.values - atlas.sdf(scan.points_mm, values, share * person.latent)).mean()
        for share in (1, 1 / 0.3)
    )
    assert off_mm < 0.1 * whole_off_mm


def test_two_patients_can_be_compared(desk, egg_atlas, tmp_path):
    engine, clinic, state = desk
    other = tmp_path / "s26.stl"
    egg(3.0, 1.0).export(other)
    reading = Reading(other)
    scan = clinic.read(egg_atlas, reading, ())
    fit, _ = clinic.fit(egg_atlas, scan, (("age", 3.0), ("sex", 1.0)))
    both = with_patient(state, OpenScan(2, other.name, reading, scan, (), fit))
    change = engine.surface(request_for(replace(both, compared=1), CHANGE, 128))
    assert change.extent_before == pytest.approx(state.fit.extent)
    assert change.colouring.values[np.abs(change.normals[:, 2]) > 0.98].mean() < -4
    clinic.forget(fit)


def test_nobody_else_sees_a_patients_code(desk, egg_atlas):
    engine, _, state = desk
    average = replace(state, patient=None)
    mine = engine.surface(request_for(state, FULL_SHAPE, 128))
    theirs = engine.surface(request_for(average, FULL_SHAPE, 128))
    assert mine.points_mm is not theirs.points_mm and theirs.extent_margin is None
    expected = Atlas.load(egg_atlas).shape(dict(state.named))
    np.testing.assert_allclose(theirs.points_mm, expected.vertices, atol=1e-3)


def test_a_far_scan_is_shown_blocked_and_can_be_aligned(desk, egg_atlas, tmp_path):
    _, clinic, _ = desk
    path = tmp_path / "far.stl"
    mesh = egg(6.0, 1.0)
    mesh.apply_translation([500, 0, 0])
    mesh.export(path)
    assert "align it" in clinic.read(egg_atlas, Reading(path), ()).blocked
    aligned = clinic.read(egg_atlas, Reading(path, align="icp"), KNOWN)
    assert not aligned.blocked and "icp" in aligned.alignment
    assert np.abs(aligned.points_mm.mean(axis=0)).max() < 5


def test_a_patient_is_shown_where_its_fit_laid_it(desk, egg_atlas, tmp_path):
    engine, clinic, state = desk
    path = tmp_path / "s27.stl"
    egg(8.0, -1.0).apply_translation([0, 0, 60]).export(path)
    reading = Reading(path, align="icp")
    scan = clinic.read(egg_atlas, reading, ())  # onto the average, which is smaller
    fit, placed = clinic.fit(egg_atlas, scan, ())
    off_mm, placed_off_mm = (np.abs(each.points_mm.mean(axis=0)).max() for each in (scan, placed))
    assert placed is not scan and placed_off_mm < max(0.3, off_mm)
    assert "onto its own fit" in placed.alignment and "onto its own fit" not in scan.alignment
    shown = with_patient(state, OpenScan(2, path.name, reading, placed, (), fit))
    colouring = engine.surface(request_for(shown, SCAN, 128)).colouring
    assert np.abs(colouring.values).mean() == pytest.approx(fit.residual_mm, rel=0.5)
    clinic.forget(fit)
    again, stays = clinic.fit(egg_atlas, placed, ())  # from where it lies now
    assert again.residual_mm < 1.1 * fit.residual_mm
    assert np.abs(stays.points_mm - placed.points_mm).max() < 1.0
    clinic.forget(again)


def test_what_is_no_such_shape_is_not_valid(desk, egg_atlas, tmp_path):
    _, clinic, _ = desk
    path = tmp_path / "ball.stl"
    trimesh.creation.icosphere(3, 12.0).export(path)
    scan = clinic.read(egg_atlas, Reading(path), ())
    fit, _ = clinic.fit(egg_atlas, scan, ())
    assert not fit.is_valid and fit.remarks[0].startswith("not valid")
    clinic.forget(fit)


def test_a_cloud_is_thinned_for_display_only(desk, egg_atlas, tmp_path):
    _, clinic, _ = desk
    path = tmp_path / "cloud.xyz"
    np.savetxt(path, trimesh.sample.sample_surface(egg(5.0, -1.0), 3 * SHOWN_POINTS, seed=0)[0])
    scan = clinic.read(egg_atlas, Reading(path), ())
    assert len(scan.faces) == 0 and 0 < len(scan.points_mm) <= SHOWN_POINTS
    fit, _ = clinic.fit(egg_atlas, scan, (("age", 5.0),))
    assert fit.residual_mm < 0.5
    clinic.forget(fit)


def test_what_cannot_be_read_is_one_sentence(desk, egg_atlas, tmp_path):
    path = tmp_path / "empty.stl"
    path.write_bytes(b"")
    with pytest.raises(InputError, match=r"empty\.stl"):
        desk[1].read(egg_atlas, Reading(path), ())


@pytest.mark.parametrize("share", [0.0, 0.81])
def test_a_fit_that_is_stopped_leaves_nobody_behind(desk, egg_atlas, share):
    """While it fits, or while the surface is made that its volume is measured on."""
    engine, clinic, state = desk
    people, told = engine.persons, [0.0]
    with pytest.raises(Cancelled):
        clinic.fit(egg_atlas, state.shown.scan, KNOWN, Progress(told.append, lambda: told[-1] >= share))
    assert engine.persons == people


@pytest.mark.parametrize(("length", "expected"), [(2.84, 2), (3.6, 5), (22, 20), (0.9, 1), (69, 50)])
def test_colour_scales_end_at_round_numbers(length, expected):
    assert rounded(length) == pytest.approx(expected)
