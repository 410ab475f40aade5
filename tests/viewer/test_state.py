"""The pure part: values, panels, what changes, undo."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from naisr_viewer import state as st
from naisr_viewer.state import AtlasCard, ExplorerState, History, Layout, Panel


@pytest.fixture
def start(card: AtlasCard) -> ExplorerState:
    return st.opened(ExplorerState(), card)


def test_an_atlas_opens_at_its_population_mean(start):
    assert start.named == (("age", 100.0), ("weight", 35.0), ("sex", 0.0))


def test_values_stay_in_the_observed_range(start):
    assert dict(st.with_value(start, "age", 9999).named)["age"] == 220.0
    assert dict(st.with_value(start, "sex", -3).named)["sex"] == -1.0


def test_age_changes_its_own_effect_and_the_full_shape_only(start):
    changed = st.changed_panels(start, st.with_value(start, "age", 12))
    assert set(changed) == {Panel("effect", "age"), st.FULL_SHAPE}


def test_a_layout_change_asks_only_for_the_panels_that_come_into_view(start):
    narrow = replace(start, layout=Layout.FULL_SHAPE)
    assert st.visible_panels(narrow) == (st.FULL_SHAPE,)
    assert st.changed_panels(start, narrow) == ()
    assert len(st.changed_panels(narrow, start)) == 4


def test_another_atlas_changes_everything(start, card):
    other = st.opened(start, replace(card))
    assert st.changed_panels(start, other) == st.all_panels(card)


def test_the_template_depends_on_no_covariate(start):
    assert st.panel_values(start, st.TEMPLATE) == ()
    assert st.panel_values(start, Panel("effect", "weight")) == (("weight", 35.0),)


def test_resets(start):
    moved = st.with_value(st.with_value(start, "age", 5), "sex", 1)
    assert st.with_centre(moved, "age").values == (100.0, 35.0, 1.0)
    assert st.with_all_centred(moved).values == start.values


def test_panels_are_named_for_people(card):
    titles = [st.panel_title(panel) for panel in st.all_panels(card)]
    assert titles == ["Template", "Age only", "Weight only", "Sex only", "Full shape"]
    assert st.label("body_weight") == "Body weight"


def test_undo_and_redo_walk_the_same_way_back_and_forth():
    visited = [(1.0,), (2.0,), (3.0,)]
    history = st.record(st.record(History(), visited[0], visited[1]), visited[1], visited[2])
    history, now = st.undo(history, visited[2])
    assert now == visited[1]
    history, now = st.undo(history, now)
    assert now == visited[0]
    assert st.undo(history, now) == (history, now)
    history, now = st.redo(history, now)
    history, now = st.redo(history, now)
    assert now == visited[2]
    assert st.redo(history, now) == (history, now)


def test_a_new_change_forgets_what_was_undone():
    history, now = st.undo(st.record(History(), (1.0,), (2.0,)), (2.0,))
    assert st.record(history, now, (5.0,)).future == ()
    assert st.record(history, now, now) is history


def test_the_undo_stack_does_not_grow_without_end():
    history = History()
    for step in range(3 * st.UNDO_DEPTH):
        history = st.record(history, (float(step),), (step + 1.0,))
    assert len(history.past) == st.UNDO_DEPTH


def test_a_toddler_of_adult_weight_is_outside_the_data(card):
    population = card.population
    assert st.is_seen(population, {"age": 12, "weight": 8})
    assert st.is_seen(population, {"age": 120, "weight": 41, "sex": 1})
    assert not st.is_seen(population, {"age": 12, "weight": 80})
    assert not st.is_seen(population, {"age": 5})  # the others at their mean: 35 kg at 5 months


def test_nearly_all_real_people_count_as_seen(card):
    population = card.population
    rows = [population.row(i) for i in np.flatnonzero(population.held_out)]
    assert np.mean([st.is_seen(population, row) for row in rows]) > 0.9


def test_without_continuous_covariates_everybody_is_seen(card):
    sex = card.covariates[2]
    population = replace(card.population, covariates=(sex,), values=np.ones((200, 1)))
    assert st.is_seen(population, {"sex": -1.0})
