"""What each kind of view says of itself."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from naisr_viewer.engine.answers.kinds import ANSWERS
from naisr_viewer.panels.kinds import (
    KINDS,
    layouts_of,
    panels_in,
    shows,
    title_of,
    visible_panels,
)
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.explorer import ExplorerState, opened, with_patient
from naisr_viewer.state.layouts import FULL_SHAPE, TEMPLATE, Layout, Panel
from naisr_viewer.state.patients import OpenScan, Reading, Scan
from naisr_viewer.state.requests import SurfaceRequest
from naisr_viewer.words.titles import label

CORNERS = np.zeros((3, 3), np.float32)


def ask(atlas: AtlasCard, resolution: int = 128, age: float = 100.0) -> SurfaceRequest:
    return SurfaceRequest(atlas.path, FULL_SHAPE, (("age", age),), resolution)


def test_every_kind_is_answered_and_every_answer_is_asked_for():
    assert set(KINDS) == set(ANSWERS)


def test_every_kind_has_a_colour_a_hint_and_a_place(card):
    for panel in panels_in(Layout.SIDE_BY_SIDE, card):
        kind = KINDS[panel.kind]
        assert kind.hint and kind.layouts and (kind.colour or panel.covariate)


def test_panels_are_named_for_people(card):
    titles = [title_of(panel) for panel in panels_in(Layout.SIDE_BY_SIDE, card)]
    assert titles == ["Template", "Age only", "Weight only", "Sex only", "Full shape"]
    assert label("body_weight") == "Body weight"
    assert title_of(Panel("effect", "{x} <b>")) == "{x} <b> only"


def test_layouts_show_their_panels_in_order(card):
    assert layouts_of(card) == tuple(Layout)
    assert FULL_SHAPE in panels_in(Layout.FULL_SHAPE, card)
    change = panels_in(Layout.CHANGE, card)
    assert [panel for panel in change if panel.kind in ("before", "shape", "change")] == [
        Panel("before"),
        FULL_SHAPE,
        Panel("change"),
    ]
    assert panels_in(Layout.SIDE_BY_SIDE, card)[0] == TEMPLATE
    state = opened(ExplorerState(), card)
    assert visible_panels(replace(state, layout=Layout.FULL_SHAPE)) == panels_in(Layout.FULL_SHAPE, card)
    assert visible_panels(ExplorerState()) == ()


def test_a_scan_is_called_what_it_is(engine, card):
    patient = OpenScan(
        1, "p", Reading(Path("p")), Scan(CORNERS, CORNERS, np.zeros((0, 3), int), "p, 3 points")
    )
    triangle = replace(patient, scan=replace(patient.scan, faces=np.array([[0, 1, 2]])))
    closed = replace(patient, scan=replace(triangle.scan, extent=41.5))
    surface, start = engine.surface(ask(card)), opened(ExplorerState(), card)
    told = [
        KINDS["scan"].caption(with_patient(start, each), surface).text for each in (patient, triangle, closed)
    ]
    for word, text in zip(("cloud of points", "open surface", "41.5 cm³"), told, strict=True):
        assert word in text


def test_a_finer_surface_answers_a_coarser_question(engine, card):
    fine = engine.surface(ask(card, age=50.0))
    assert shows(fine, ask(card, resolution=40, age=50.0))
    assert not shows(fine, ask(card, resolution=256, age=50.0))
    assert not shows(fine, ask(card, resolution=40, age=51.0))
    assert not shows(None, ask(card))
