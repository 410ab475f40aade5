"""Maps on surfaces: exact ones are the library's, previews agree with them, each under its own key."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from naisr_viewer.panels.kinds import request_for
from naisr_viewer.panels.maps import map_of, numbers_of, words_of_maps
from naisr_viewer.panels.scales import PanelScale, fitted_limit, rounded_up, scale_of
from naisr_viewer.state.explorer import ExplorerState, with_value
from naisr_viewer.state.layouts import FULL_SHAPE, TEMPLATE, Layout, Panel
from naisr_viewer.state.overlay import Map, Overlay, Quantity, with_limit
from naisr_viewer.state.requests import EXACT_RESOLUTION, PREVIEW_RESOLUTION, Origin

AGE, SEX = Panel("effect", "age"), Panel("effect", "sex")
DISPLACEMENT, RATE = Quantity.DISPLACEMENT, Quantity.RATE


@pytest.fixture(scope="module")
def situation(desk):
    """The fitted patient three years later, and the tables for it."""
    engine, _, state = desk
    state = with_value(replace(state, layout=Layout.SIDE_BY_SIDE, touched="age"), "age", 8.0)
    assert state.atlas is not None
    for person in {0, state.person}:
        engine.prepare_previews(state.atlas.path, person)
    return engine, state


def with_scale(state: ExplorerState, panel: Panel) -> PanelScale:
    scale = scale_of(state, panel)
    assert scale is not None
    return scale


def seen(state: ExplorerState, quantity: Quantity) -> ExplorerState:
    return replace(state, overlay=replace(state.overlay, quantity=quantity))


@pytest.mark.parametrize("panel", [AGE, SEX, FULL_SHAPE])
@pytest.mark.parametrize("quantity", [DISPLACEMENT, RATE])
def test_a_map_is_exact_at_rest_and_nearly_so_on_the_way(situation, panel, quantity):
    engine, state = situation
    state = seen(state, quantity)
    exact = engine.surface(request_for(state, panel, EXACT_RESOLUTION))
    preview = engine.surface(request_for(state, panel, PREVIEW_RESOLUTION))
    assert exact.is_exact and preview.origin is Origin.TABLES
    wanted = by_the_library(engine, state, panel, exact)
    np.testing.assert_allclose(exact.colouring.values, wanted, atol=1e-4)
    nearest = np.linalg.norm(preview.points_mm[:, None] - exact.points_mm[None, ::7], axis=2).argmin(axis=0)
    off = np.abs(preview.colouring.values[nearest] - exact.colouring.values[::7])
    assert np.quantile(off, 0.95) < 0.15 * np.abs(exact.colouring.values).max() + 0.05
    assert exact.colouring.limit == preview.colouring.limit > 0


def by_the_library(engine, state, panel, surface) -> np.ndarray:
    request = request_for(state, panel, 0)
    atlas = engine.atlas(state.atlas.path)
    latent = engine.who(state.atlas.path, request.person).fitted.at(request.values).latent
    values, name = dict(request.values), panel.covariate or "age"
    if state.overlay.quantity is DISPLACEMENT:
        return np.asarray(atlas.moved_mm(surface.points_mm, values, latent))
    ask = atlas.contrast_mm if name == "sex" else atlas.rates_mm
    return np.asarray(ask(surface.points_mm, name, values, latent))


def test_plain_and_coloured_surfaces_are_remembered_apart(situation):
    engine, state = situation
    plain = engine.surface(request_for(state, AGE, EXACT_RESOLUTION))
    mapped = engine.surface(request_for(seen(state, DISPLACEMENT), AGE, EXACT_RESOLUTION))
    assert plain.colouring is None and mapped.colouring is not None
    assert mapped.points_mm is plain.points_mm
    assert engine.cached(request_for(state, AGE, EXACT_RESOLUTION)).colouring is None


def test_what_is_asked_follows_what_was_moved_last(situation):
    _, state = situation
    assert map_of(state) is None
    assert map_of(seen(state, DISPLACEMENT)) == Map(DISPLACEMENT)
    assert map_of(seen(replace(state, touched="sex"), RATE)) == Map(RATE, "sex")
    assert map_of(seen(replace(state, touched=""), RATE)) == Map(RATE, "age")
    assert request_for(seen(state, RATE), SEX, 0).map == Map(RATE, "sex")
    assert request_for(seen(state, RATE), TEMPLATE, 0).map is None
    assert numbers_of(state.atlas, Map(RATE, "age")).unit == "mm per year"
    assert numbers_of(state.atlas, Map(RATE, "sex")).unit == "mm, M against F"
    assert words_of_maps(seen(state, RATE)) == "Full shape: Age, mm per year"


def test_surfaces_with_one_unit_share_a_scale_until_they_do_not(situation):
    engine, state = situation
    state = seen(state, DISPLACEMENT)
    shown = {
        panel: engine.surface(request_for(state, panel, PREVIEW_RESOLUTION))
        for panel in (AGE, SEX, FULL_SHAPE)
    }
    most = {panel: float(np.abs(result.colouring.values).max()) for panel, result in shown.items()}
    assert fitted_limit(state, SEX, shown) == rounded_up(max(most.values()))
    moved = replace(state, overlay=with_limit(state.overlay, with_scale(state, SEX).key, 3.5))
    assert {with_scale(moved, panel).limit for panel in shown} == {3.5}
    apart = replace(moved, overlay=replace(moved.overlay, is_shared=False))
    assert {with_scale(apart, panel).limit for panel in shown} == {None}
    assert fitted_limit(apart, SEX, shown) == rounded_up(most[SEX])
    rates = seen(state, RATE)
    age, both, sex = (with_scale(rates, panel).key for panel in (AGE, FULL_SHAPE, SEX))
    assert age == both != sex
    assert scale_of(replace(state, overlay=Overlay()), AGE) is None


@pytest.mark.parametrize(("number", "end"), [(8.507, 8.6), (0.0311, 0.032), (250.1, 260), (9.99, 10)])
def test_the_end_of_a_scale_is_a_round_number(number, end):
    assert rounded_up(number) == pytest.approx(end)
