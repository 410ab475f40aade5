"""Pinned places: found again, and moved by parts that add up, against the field and finite differences."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from naisr_model.errors import InputError
from naisr_model.frames import Frame
from naisr_viewer.engine.ledgers import ledger, origin_mm
from naisr_viewer.panels.kinds import request_for, visible_panels
from naisr_viewer.panels.pins import can_pin, ledger_request
from naisr_viewer.state.explorer import ExplorerState, knowing_norms, pinned, showing, with_value
from naisr_viewer.state.layouts import FULL_SHAPE, TEMPLATE, Layout, Panel
from naisr_viewer.state.pins import Entry, LedgerRequest, Part, Pin, Shown
from naisr_viewer.words import ledger as words

PIN = Pin(1, (0.0, 0.0, 0.0))
AGE_ONLY = Panel("effect", "age")


def asked(state: ExplorerState) -> LedgerRequest:
    request = ledger_request(state)
    assert request is not None
    return request


@pytest.fixture(scope="module")
def clicked(desk):
    """The fitted patient two years younger, a point of that shape, and the state in which it is pinned."""
    engine, _, state = desk
    state = with_value(replace(state, layout=Layout.SIDE_BY_SIDE), "age", 4.0)
    surface = engine.surface(request_for(state, FULL_SHAPE, 64))
    point_mm = tuple(surface.points_mm[100].tolist())
    return engine, point_mm, pinned(state, origin_mm(engine, surface.request, point_mm))


@pytest.fixture(scope="module")
def told(clicked):
    engine, _, state = clicked
    return ledger(engine, asked(state))


def test_a_place_is_found_where_it_was_clicked(clicked, told):
    _, point_mm, _ = clicked
    ((_, found_mm),) = dict(told.places)[FULL_SHAPE]
    np.testing.assert_allclose(found_mm, point_mm, atol=0.02)


def test_a_place_is_in_every_surface_that_is_seen_and_modelled(clicked, told):
    engine, _, state = clicked
    assert {panel for panel, _ in told.places} == set(visible_panels(state))
    atlas, places = engine.atlas(state.atlas.path), dict(told.places)
    ((_, origin),) = places[TEMPLATE]
    np.testing.assert_allclose(origin, state.pins[0].origin_mm, atol=1e-3)
    latent = engine.who(state.atlas.path, state.person).fitted.at(state.named).latent
    values = dict(request_for(state, AGE_ONLY, 0).values)
    ((_, in_effect),) = places[AGE_ONLY]
    own = np.zeros_like(latent) if not request_for(state, AGE_ONLY, 0).person else latent
    assert atlas.sdf([in_effect], values, own)[0] == pytest.approx(atlas.sdf([origin], {})[0], abs=1e-3)


def test_the_bars_add_up_to_the_way_along_the_normal(clicked, told):
    engine, point_mm, state = clicked
    (entry,) = told.entries
    total = sum(part.normal_mm for part in entry.parts) + entry.person.normal_mm
    assert total == pytest.approx(entry.total.normal_mm, abs=1e-3)
    latent = engine.who(state.atlas.path, state.person).fitted.at(state.named).latent
    normal = slope(engine.atlas(state.atlas.path), point_mm, dict(state.named), latent)
    moved_mm = np.subtract(point_mm, state.pins[0].origin_mm)
    assert entry.total.normal_mm == pytest.approx(moved_mm @ normal, abs=2e-2)
    rest = moved_mm - (moved_mm @ normal) * normal
    assert entry.total.tangential_mm == pytest.approx(np.linalg.norm(rest), abs=2e-2)
    assert [part.cause for part in entry.parts] == ["age", "sex"]
    assert entry.parts[0].normal_mm != 0


def test_how_sure_a_bar_is_stands_beside_it_once_its_people_are_known(clicked, told, monkeypatch):
    monkeypatch.setattr("naisr_model.measures.curves.COARSE", 32)
    engine, _, state = clicked
    assert all(part.margin_mm is None for part in (*told.entries[0].parts, told.entries[0].total))
    norms = engine.norms(state.atlas.path)
    (entry,) = ledger(engine, asked(knowing_norms(state))).entries
    age, sex = entry.parts
    assert replace(age, margin_mm=None) == told.entries[0].parts[0]
    origin, values = [state.pins[0].origin_mm], dict(state.named)
    (of_age,), (of_sex,) = norms.effect_margins_mm(origin, [{name: values[name]} for name in ("age", "sex")])
    assert (age.margin_mm, sex.margin_mm) == (of_age, of_sex) and min(of_age, of_sex) > 0
    assert entry.total.margin_mm is None  # of a person: the code is not the population's
    request = asked(knowing_norms(state))
    average = replace(request, whole=replace(request.whole, person=0), others=())
    assert (ledger(engine, average).entries[0].total.margin_mm or 0) > 0


def test_what_is_less_than_its_interval_is_not_told_from_nothing():
    entry = Entry(PIN, (Part("age", 2.314, 0.0, 0.12),), None, Part("", -0.1, 0.04, 0.3))
    assert words.told(entry, "mm") == (
        "Place 1\nAge: +2.31 ± 0.12 mm, 0.00 mm along it\n"
        "Together: −0.10 ± 0.30 mm, not told from nothing, 0.04 mm along it"
    )


def slope(atlas, point_mm, values, latent) -> np.ndarray:
    """The outward normal by central differences of the signed distance."""
    step_mm = 0.05 * np.eye(3)
    ahead, behind = (atlas.sdf(point_mm + side * step_mm, values, latent) for side in (1, -1))
    return (ahead - behind) / np.linalg.norm(ahead - behind)


def test_nobody_in_particular_has_no_line(clicked):
    engine, _, state = clicked
    (entry,) = ledger(engine, asked(showing(state, None))).entries
    assert entry.person is None
    assert sum(part.normal_mm for part in entry.parts) == pytest.approx(entry.total.normal_mm, abs=1e-3)


def test_a_scan_is_measured_and_has_no_material_points(desk):
    _, _, state = desk
    state = replace(state, layout=Layout.FIT)
    assert can_pin(state, FULL_SHAPE) and not can_pin(state, Panel("scan"))
    request = asked(pinned(state, (0.0, 0.0, 0.0)))
    assert Panel("scan") in visible_panels(state)
    assert Panel("scan") not in {shown.panel for shown in (request.whole, *request.others)}


class Folding:
    """An atlas that moves all by 1 mm, and folds beyond x = 50 mm."""

    checkpoint = SimpleNamespace(latents=np.zeros((1, 2)))
    frame = Frame((0.0, 0.0, 0.0), 1.0)
    population = SimpleNamespace(names=("age",))

    def carried_mm(self, origins_mm, covariates, latents):
        if np.max(origins_mm) > 50:
            raise InputError("the deformation folds")
        return np.stack([np.add(origins_mm, [1.0, 0.0, 0.0])] * len(covariates))

    def contributions(self, origins_mm, covariates, latent, start_mm):
        moved = np.subtract(start_mm, origins_mm)
        normals = np.tile([1.0, 0.0, 0.0], (len(moved), 1))
        return SimpleNamespace(normals=normals, effects_mm=moved[None], person_mm=0 * moved)


def test_a_place_at_a_fold_is_left_out_and_the_others_are_told():
    source = SimpleNamespace(atlas=lambda _: Folding(), who=lambda *_: SimpleNamespace(fitted=None))
    pins = (Pin(1, (0.0, 0.0, 0.0)), Pin(2, (60.0, 0.0, 0.0)), Pin(3, (5.0, 0.0, 0.0)))
    whole = Shown(FULL_SHAPE, (("age", 4.0),), 0)
    told = ledger(source, LedgerRequest(Path("a.safetensors"), pins, whole, (Shown(TEMPLATE, (), 0),)))
    assert [entry.pin.number for entry in told.entries] == [1, 3]
    assert dict(told.places)[TEMPLATE] == ((1, (1.0, 0.0, 0.0)), (3, (6.0, 0.0, 0.0)))
    assert told.entries[0].total.normal_mm == 1.0 and told.entries[0].total.tangential_mm == 0.0
