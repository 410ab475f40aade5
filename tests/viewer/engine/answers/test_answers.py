"""What each kind of view shows of a patient, with an atlas that was really trained."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from naisr_model.atlas import Atlas
from naisr_model.data.samples import signed_distance
from naisr_model.errors import Cancelled
from naisr_viewer.engine.clinic import Clinic
from naisr_viewer.engine.engine import Engine
from naisr_viewer.panels.kinds import request_for
from naisr_viewer.state.explorer import ExplorerState, opened, with_patient, with_value
from naisr_viewer.state.layouts import FULL_SHAPE, Panel
from naisr_viewer.state.patients import OpenScan, Reading

BEFORE = Panel("before")
UNCERTAINTY = Panel("uncertainty")
CHANGE = Panel("change")
DEVIATION = Panel("deviation")
SCAN = Panel("scan")

KNOWN = (("age", 6.0), ("sex", 1.0))


def test_the_scan_carries_its_distance_to_the_shape(desk):
    engine, _, state = desk
    shape = engine.surface(request_for(state, FULL_SHAPE, 128))
    scan = engine.surface(request_for(state, SCAN, 128))
    mesh = trimesh.Trimesh(shape.points_mm, shape.faces, process=False)
    outside_mm = signed_distance(mesh, scan.points_mm.astype(np.float64))
    assert scan.colouring.scale == "signed"
    np.testing.assert_allclose(scan.colouring.values, outside_mm, atol=0.1)
    assert engine.surface(request_for(state, SCAN, 40)).colouring is None  # on the way there is no time


def test_a_younger_shape_leaves_the_scan_outside(desk):
    engine, _, state = desk
    scan = engine.surface(request_for(with_value(state, "age", 3.0), SCAN, 128))
    poles = np.abs(scan.points_mm[:, 2] - scan.points_mm[:, 2].mean()) > 28
    assert scan.colouring.values[poles].mean() > 2


def test_uncertainty_is_positive_and_grows_with_what_is_not_known(desk, egg_atlas):
    engine, clinic, state = desk
    told = engine.surface(request_for(state, UNCERTAINTY, 128))
    assert told.colouring.scale == "unsigned" and (told.colouring.values > 0).all()
    fit, _ = clinic.fit(egg_atlas, state.shown.scan, ())
    assert {name for name, _, _ in fit.intervals} == {"age", "sex"}
    untold = with_patient(state, replace(state.shown, known=(), fit=fit))
    unsure = engine.surface(request_for(untold, UNCERTAINTY, 128))
    assert np.mean(unsure.colouring.values) > 0.5 * np.mean(told.colouring.values)
    clinic.forget(fit)
    with pytest.raises(Cancelled):
        engine.surface(request_for(untold, UNCERTAINTY, 128))


@pytest.mark.parametrize("codes", [0.0, 8.0])
def test_the_deviation_from_the_average_is_what_sets_a_patient_apart(egg_atlas, tmp_path, codes):
    """Integrated over the surface it is the difference of the volumes, to first order."""
    atlas, file = Atlas.load(egg_atlas), tmp_path / "someone.stl"
    atlas.shape(dict(KNOWN), codes * atlas.checkpoint.latents[0], 64).export(file)
    engine = Engine(folder=tmp_path / "cache")
    clinic, state = Clinic(engine), opened(ExplorerState(), engine.open(egg_atlas))
    scan = clinic.read(egg_atlas, Reading(file), KNOWN)
    fit, _ = clinic.fit(egg_atlas, scan, KNOWN)
    state = with_patient(state, OpenScan(1, file.name, Reading(file), scan, KNOWN, fit))
    told = engine.surface(request_for(state, DEVIATION, 128))
    average = engine.surface(replace(request_for(state, FULL_SHAPE, 128), person=0))
    assert told.colouring is not None
    area_mm2 = trimesh.Trimesh(told.points_mm, told.faces, process=False).area
    gained_cm3 = told.colouring.values.mean() * area_mm2 / 1000
    assert gained_cm3 == pytest.approx(told.extent - average.extent, abs=0.2)
    if codes == 0:
        np.testing.assert_allclose(told.colouring.values, 0, atol=0.3)
    else:
        assert np.abs(told.colouring.values).max() > 0.5
    assert engine.surface(request_for(state, DEVIATION, 40)).colouring is None


def test_a_change_is_counted_along_the_normals_from_point_to_point(desk):
    """Eggs grow 2 mm a year at each pole and not at the equator."""
    engine, _, state = desk
    still = engine.surface(request_for(state, CHANGE, 128))
    np.testing.assert_allclose(still.colouring.values, 0, atol=0.1)
    older = with_value(state, "age", 8.0)
    before = engine.surface(request_for(older, BEFORE, 128))
    after = engine.surface(request_for(older, FULL_SHAPE, 128))
    for resolution in (40, 128):
        change = engine.surface(request_for(older, CHANGE, resolution))
        up = np.abs(change.normals[:, 2])
        assert change.colouring.values[up > 0.98].mean() == pytest.approx(4, abs=1)
        assert np.abs(change.colouring.values[up < 0.1]).mean() < 0.5
        gained = change.extent - change.extent_before
        assert gained == pytest.approx(after.extent - before.extent, rel=0.05)
    assert after.extent_margin > 0
