"""Pinned places as part of the state."""

from __future__ import annotations

import pytest

from naisr_viewer.state.drawer import Tab
from naisr_viewer.state.explorer import ExplorerState, opened, pinned, without_pin, without_pins
from naisr_viewer.state.history import History, record, redo, undo


@pytest.fixture
def start(card) -> ExplorerState:
    return opened(ExplorerState(), card)


def with_pins(state: ExplorerState, count: int) -> ExplorerState:
    for i in range(count):
        state = pinned(state, (float(i), 0.0, 0.0))
    return state


def numbers(state: ExplorerState) -> list[int]:
    return [pin.number for pin in state.pins]


def test_the_fourth_takes_the_place_and_number_of_the_first(start):
    assert numbers(with_pins(start, 3)) == [1, 2, 3]
    state = with_pins(start, 4)
    assert numbers(state) == [2, 3, 1]
    assert [pin.origin_mm[0] for pin in state.pins] == [1.0, 2.0, 3.0]


def test_a_pin_is_told_of_unless_something_else_is_open(start):
    assert with_pins(start, 1).drawer is Tab.POINT
    assert without_pins(with_pins(start, 2)).drawer is None


def test_one_is_removed_and_its_number_is_free_again(start):
    state = without_pin(with_pins(start, 3), 2)
    assert numbers(state) == [1, 3] and state.drawer is Tab.POINT
    assert sorted(numbers(pinned(state, (9.0, 0.0, 0.0)))) == [1, 2, 3]
    assert without_pin(with_pins(start, 1), 1).drawer is None


def test_pins_are_undone_and_redone(start):
    one, two = with_pins(start, 1), with_pins(start, 2)
    history = record(record(History(), start, one), one, two)
    history, now = undo(history, two)
    assert numbers(now) == [1]
    history, now = undo(history, now)
    assert now.pins == ()
    assert numbers(redo(history, now)[1]) == [1]


def test_another_atlas_has_no_pins(start, card):
    state = opened(with_pins(start, 2), card)
    assert state.pins == () and state.drawer is Tab.POINT
