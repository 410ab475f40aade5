"""Two versions of one scan beside each other: a widened ring is seen, measured, and not expressed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from eggs import egg

from naisr_viewer.engine.clinic import Clinic
from naisr_viewer.engine.engine import Engine
from naisr_viewer.panels.kinds import caption_of, request_for, visible_panels
from naisr_viewer.state.explorer import ExplorerState, opened, showing, with_patient
from naisr_viewer.state.layouts import Layout, Panel
from naisr_viewer.state.patients import OpenScan, Reading
from naisr_viewer.state.requests import EXACT_RESOLUTION

KNOWN = (("age", 6.0), ("sex", 1.0))
SCANS, SCAN = Panel("scans"), Panel("scan")
WIDENED_MM = 2.0


def with_ring(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The same with a ring about the middle widened by 2 mm."""
    height = mesh.vertices[:, 2] - 8.0
    outwards = mesh.vertices * [1.0, 1.0, 0.0]
    outwards /= np.linalg.norm(outwards, axis=1, keepdims=True).clip(1e-9)
    return trimesh.Trimesh(
        mesh.vertices + WIDENED_MM * np.exp(-((height / 3.0) ** 2))[:, None] * outwards,
        mesh.faces,
        process=False,
    )


@pytest.fixture(scope="module")
def meshes() -> tuple[trimesh.Trimesh, trimesh.Trimesh]:
    plain = egg(6.0, 1.0).subdivide()
    return plain, with_ring(plain)


@pytest.fixture(scope="module")
def both(egg_atlas, meshes, tmp_path_factory):
    """Engine, and the state in which the second version is shown and compared with the first."""
    folder = tmp_path_factory.mktemp("scans")
    engine = Engine(folder=folder / "cache")
    clinic = Clinic(engine)
    state = opened(ExplorerState(), engine.open(egg_atlas))
    for key, mesh in enumerate(meshes, start=1):
        file = folder / f"version{key}.stl"
        mesh.export(file)
        reading = Reading(file)
        fit, scan = clinic.fit(egg_atlas, clinic.read(egg_atlas, reading, KNOWN), KNOWN)
        state = with_patient(state, OpenScan(key, file.name, reading, scan, KNOWN, fit))
    return engine, replace(showing(state, 2), compared=1, layout=Layout.CHANGE)


def test_the_difference_of_the_scans_is_seen_and_told(both, meshes):
    engine, state = both
    assert SCANS in visible_panels(state)
    result = engine.surface(request_for(state, SCANS, EXACT_RESOLUTION))
    assert result.colouring.values.max() == pytest.approx(WIDENED_MM, abs=0.3)
    far = np.abs(result.points_mm[:, 2] - 8.0) > 12.0
    assert np.abs(result.colouring.values[far]).max() < 0.05
    plain, wide = (mesh.volume / 1000 for mesh in meshes)
    assert result.extent - result.extent_before == pytest.approx(wide - plain, rel=0.05)
    assert f"+{wide - plain:.1f} cm³" in caption_of(state, result).text


def test_without_another_scan_there_is_nothing_beside(both):
    _, state = both
    assert SCANS not in visible_panels(replace(state, compared=None))
    assert SCANS not in visible_panels(replace(state, compared=2))
    assert SCANS not in visible_panels(replace(state, layout=Layout.FIT))


def test_what_is_on_screen_can_be_asked_for_when_its_patient_is_left(both):
    _, state = both
    assert request_for(showing(state, None), SCANS, 0).person == 0


def test_a_place_that_the_atlas_cannot_express_is_told(both):
    engine, state = both
    told = {}
    for key in (1, 2):
        shown = replace(showing(state, key), layout=Layout.FIT)
        result = engine.surface(request_for(shown, SCAN, EXACT_RESOLUTION))
        told[key] = (result.unexpressed, caption_of(shown, result).text)
    assert told[1][0] < 0.01 < told[2][0]
    assert "cannot be expressed" in told[2][1] and "cannot be expressed" not in told[1][1]


def test_of_another_day_nothing_is_said_of_what_can_be_expressed(both):
    engine, state = both
    shown = replace(showing(state, 2), layout=Layout.FIT)
    other_day = replace(shown, values=(3.0, 1.0))
    assert engine.surface(request_for(other_day, SCAN, EXACT_RESOLUTION)).unexpressed is None
