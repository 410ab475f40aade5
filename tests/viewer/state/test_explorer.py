"""The pure part: values, patients, what changes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from naisr_viewer.panels.kinds import request_for, visible_panels
from naisr_viewer.state import explorer as st
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.layouts import FULL_SHAPE, TEMPLATE, Layout, Panel
from naisr_viewer.state.patients import Fitted, Named, OpenScan, Reading, Scan

BEFORE, CHANGE = Panel("before"), Panel("change")


@pytest.fixture
def start(card: AtlasCard) -> ExplorerState:
    return st.opened(ExplorerState(), card)


def test_an_atlas_opens_at_its_population_mean(start):
    assert start.named == (("age", 100.0), ("weight", 35.0), ("sex", 0.0))


def test_values_stay_in_the_observed_range(start):
    assert dict(st.with_value(start, "age", 9999).named)["age"] == 220.0
    assert dict(st.with_value(start, "sex", -3).named)["sex"] == -1.0


def changed(old: ExplorerState, new: ExplorerState) -> set[Panel]:
    """Panels on screen that are asked for anew."""
    asked = {request_for(old, panel, 128) for panel in visible_panels(old)}
    return {panel for panel in visible_panels(new) if request_for(new, panel, 128) not in asked}


def test_age_changes_its_own_effect_and_the_full_shape_only(start):
    assert changed(start, st.with_value(start, "age", 12)) == {Panel("effect", "age"), FULL_SHAPE}


def test_a_layout_change_asks_only_for_the_panels_that_come_into_view(start):
    narrow = replace(start, layout=Layout.FULL_SHAPE)
    assert visible_panels(narrow) == (FULL_SHAPE,)
    assert changed(start, narrow) == set()
    assert len(changed(narrow, start)) == 4


def test_the_template_depends_on_no_covariate(start):
    assert request_for(start, TEMPLATE, 0).values == ()
    assert request_for(start, Panel("effect", "weight"), 0).values == (("weight", 35.0),)


def test_resets(start):
    moved = st.with_value(st.with_value(start, "age", 5), "sex", 1)
    assert st.reset(moved, "age").values == (100.0, 35.0, 1.0)
    assert st.reset_all(moved).values == start.values


def test_the_others_follow_as_in_the_population_and_back(start):
    """The children of the stand-in gain 0.31 kg a month."""
    older = st.followed(st.with_value(start, "age", 160), "age", start.values)
    assert older.values[1] == pytest.approx(35 + 0.31 * 60, abs=1.5)
    assert older.values[2] == 0.0  # nobody's sex follows their age
    back = st.followed(st.with_value(older, "age", 100), "age", start.values)
    assert back.values == pytest.approx(start.values)


def test_what_is_off_the_population_stays_off(start):
    heavy = st.with_value(start, "weight", 50)
    older = st.followed(st.with_value(heavy, "age", 160), "age", heavy.values)
    plain = st.followed(st.with_value(start, "age", 160), "age", start.values)
    assert older.values[1] - plain.values[1] == pytest.approx(15)


# --- patients -------------------------------------------------------------------------------------


def patient(key: int, known: Named = (), person: int = 0, age: float = 84.0) -> OpenScan:
    none = np.zeros((0, 3), np.float32)
    scan = Scan(none, none, none.astype(np.int64), "p.stl")
    values = (("age", age), ("weight", 20.0), ("sex", 1.0))
    fit = Fitted(person, values, (("weight", 18.0, 22.0),), 48.0, 2.0, 0.3, 0.4, 1.0) if person else None
    return OpenScan(key, f"p{key}.stl", Reading(Path(f"p{key}.stl")), scan, known, fit)


def test_a_scan_that_is_not_fitted_is_shown_over_the_average_at_what_is_known(start):
    state = st.with_patient(start, patient(1, (("age", 84.0),)))
    assert state.named == (("age", 84.0), ("weight", 35.0), ("sex", 0.0))
    assert state.person == 0 and state.home == start.values


def test_a_fitted_patient_is_home(start):
    state = st.with_patient(start, patient(1, person=7))
    assert state.values == state.home == (84.0, 20.0, 1.0)
    assert st.reset_all(st.with_value(state, "age", 200)).values == (84.0, 20.0, 1.0)
    assert request_for(state, FULL_SHAPE, 128).person == 7
    assert request_for(state, TEMPLATE, 128).person == 0  # everybody's


def test_changes_are_counted_from_the_patient_as_fitted_or_from_another(start):
    state = st.with_patient(st.with_patient(start, patient(1, person=7, age=60)), patient(2, person=8))
    state = st.with_value(replace(state, layout=Layout.CHANGE), "age", 120)
    assert visible_panels(state) == (BEFORE, FULL_SHAPE, CHANGE)
    own = request_for(state, CHANGE, 128)
    assert own.person == 8 and own.before == (8, (("age", 84.0), ("weight", 20.0), ("sex", 1.0)))
    other = replace(state, compared=1)
    assert request_for(other, CHANGE, 128).before == (7, (("age", 60.0), ("weight", 20.0), ("sex", 1.0)))
    before = request_for(other, BEFORE, 128)
    assert before.person == 7 and dict(before.values)["age"] == 60
    assert changed(state, st.with_value(state, "age", 121)) == {FULL_SHAPE, CHANGE}


def test_closing_a_patient_shows_the_last_of_the_others(start):
    state = st.with_patient(st.with_patient(start, patient(1, person=7)), patient(2, person=8))
    state = replace(state, compared=1, layout=Layout.FIT)
    left = st.without_patient(state, 2)
    assert left.patient == 1 and left.compared == 1 and left.layout is Layout.FIT
    nobody = st.without_patient(left, 1)
    assert nobody.patient is None and nobody.compared is None
    assert nobody.layout is Layout.SIDE_BY_SIDE and nobody.values == start.values


def test_another_atlas_has_other_patients(start, card):
    state = replace(st.with_patient(start, patient(1, person=7)), layout=Layout.CHANGE)
    assert st.opened(state, card).patients == () and st.opened(state, card).layout is Layout.SIDE_BY_SIDE
