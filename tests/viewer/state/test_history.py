"""Undo and redo."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from naisr_viewer.state.explorer import (
    ExplorerState,
    opened,
    showing,
    with_patient,
    with_value,
    without_patient,
)
from naisr_viewer.state.history import UNDO_DEPTH, History, persons, record, redo, undo
from naisr_viewer.state.layouts import Layout
from naisr_viewer.state.patients import Fitted, OpenScan, Reading, Scan


@pytest.fixture
def start(card) -> ExplorerState:
    return opened(ExplorerState(), card)


def at(state: ExplorerState, age: float) -> ExplorerState:
    return with_value(state, "age", age)


def scanned(key: int) -> OpenScan:
    points_mm, faces = np.zeros((3, 3), np.float32), np.zeros((0, 3), np.int64)
    return OpenScan(key, f"p{key}.stl", Reading(Path(f"p{key}.stl")), Scan(points_mm, points_mm, faces, ""))


def fitted(patient: OpenScan, person: int) -> OpenScan:
    values = (("age", 60.0), ("weight", 20.0), ("sex", 1.0))
    return replace(patient, fit=Fitted(person, values, (), 40.0, 2.0, 0.3, 0.4, 1.0))


def test_undo_and_redo_walk_the_same_way_back_and_forth(start):
    visited = [at(start, age) for age in (10.0, 20.0, 30.0)]
    history = record(record(History(), visited[0], visited[1]), visited[1], visited[2])
    history, now = undo(history, visited[2])
    assert now == visited[1]
    history, now = undo(history, now)
    assert now == visited[0]
    assert undo(history, now) == (history, now)
    history, now = redo(history, now)
    history, now = redo(history, now)
    assert now == visited[2]
    assert redo(history, now) == (history, now)


def test_a_new_act_forgets_what_was_undone(start):
    history, now = undo(record(History(), at(start, 10), at(start, 20)), at(start, 20))
    assert record(history, now, at(start, 50)).future == ()
    assert record(history, now, now) is history


def test_the_undo_stack_does_not_grow_without_end(start):
    history = History()
    for step in range(3 * UNDO_DEPTH):
        history = record(history, at(start, 1 + step), at(start, 2 + step))
    assert len(history.past) == UNDO_DEPTH


def test_a_closed_patient_comes_back_with_its_fit_and_the_layout(start):
    patient = fitted(scanned(1), person=7)
    before = replace(with_patient(start, patient), layout=Layout.FIT)
    after = without_patient(before, 1)
    assert after.patients == () and after.layout is Layout.SIDE_BY_SIDE
    history = record(History(), before, after)
    assert persons(history, after) == {7}
    history, now = undo(history, after)
    assert now.shown is patient and now.fit is patient.fit and now.layout is Layout.FIT
    _, now = redo(history, now)
    assert now.patients == () and now.layout is Layout.SIDE_BY_SIDE


def test_how_it_is_looked_at_is_not_undone(start):
    history = record(History(), start, at(start, 50))
    now = replace(at(start, 50), layout=Layout.FULL_SHAPE, follow=True, has_ghost=False)
    _, now = undo(history, now)
    assert now.values == start.values
    assert (now.layout, now.follow, now.has_ghost) == (Layout.FULL_SHAPE, True, False)
    assert record(history, now, replace(now, layout=Layout.SIDE_BY_SIDE)) is history


def test_undo_returns_to_whom_the_act_was_about(start):
    first, second = fitted(scanned(1), 1), fitted(scanned(2), 2)
    both = showing(with_patient(with_patient(start, first), second), 1)
    moved = at(both, 150)
    history, now = undo(record(History(), both, moved), showing(moved, 2))
    assert now.patient == 1 and now.values == both.values
    assert redo(history, now)[1].values == moved.values


def test_fits_are_held_as_long_as_somebody_refers_to_them(start):
    patient = scanned(1)
    first = with_patient(start, fitted(patient, 1))
    second = with_patient(first, fitted(patient, 2))
    history = record(History(), first, second)
    assert persons(history, second) == {1, 2}
    for step in range(UNDO_DEPTH):
        history = record(history, at(second, 1 + step), at(second, 2 + step))
    assert persons(history, second) == {2}
