"""Commands as values, and what Qt shows of them."""

from __future__ import annotations

from itertools import combinations
from unittest.mock import Mock

import pytest
from PySide6.QtGui import QKeySequence
from PySide6.QtWidgets import QMenu, QWidget

from naisr_viewer.state.explorer import ExplorerState, opened
from naisr_viewer.state.layouts import Layout
from naisr_viewer.state.theme import ThemeChoice
from naisr_viewer.views import actions as va
from naisr_viewer.views.actions import (
    COMMANDS,
    EXAMPLE,
    EXAMPLES,
    MENUS,
    RECENT,
    SEPARATOR,
    TOOLBAR,
    Command,
    Fact,
)
from naisr_viewer.views.main_window import MainWindow

NAMES = [command.name for command in COMMANDS]


@pytest.fixture
def parent(qtbot) -> QWidget:
    widget = QWidget()
    qtbot.addWidget(widget)
    return widget


def of(name: str) -> Command:
    return COMMANDS[NAMES.index(name)]


def test_names_and_keys_are_given_once():
    assert len(set(NAMES)) == len(NAMES)
    keys = [QKeySequence(each) for command in COMMANDS for each in command.keys]
    assert all(not each.isEmpty() for each in keys)
    assert all(one != other for one, other in combinations(keys, 2))


def test_menus_offer_every_command_once_and_nothing_else():
    submenus = {RECENT: [], EXAMPLE: [command.name for command in EXAMPLES]}
    entries = [name for names in MENUS.values() for name in names if name != SEPARATOR]
    offered = [name for entry in entries for name in submenus.get(entry, [entry])]
    assert sorted(offered) == sorted(NAMES)
    assert set(TOOLBAR) - {SEPARATOR} <= set(NAMES)


@pytest.mark.parametrize(
    ("facts", "enabled", "disabled"),
    [
        (set(), ["open atlas", "quit", "about", "theme dark"], ["screenshot", "undo", "from above"]),
        ({Fact.ATLAS}, ["screenshot", "from above", "layout side by side"], ["export", "layout fit"]),
        ({Fact.ATLAS, Fact.REST}, ["export", "open scan", "reset all"], ["undo", "redo", "layout fit"]),
        ({Fact.ATLAS, Fact.FIT}, ["layout fit"], ["open scan", "layout before and after"]),
        ({Fact.ATLAS, Fact.FIT, Fact.FORECAST}, ["layout fit", "layout before and after"], ["open scan"]),
        ({Fact.ATLAS, Fact.PAST, Fact.FUTURE}, [], ["undo", "redo"]),
        ({Fact.ATLAS, Fact.REST, Fact.PAST}, ["undo"], ["redo"]),
        ({Fact.ATLAS, Fact.REST, Fact.FUTURE}, ["redo"], ["undo"]),
    ],
)
def test_commands_are_enabled_by_what_is_so(parent, facts, enabled, disabled):
    made = va.make_actions(COMMANDS, Mock(), parent)
    va.enable(COMMANDS, made, facts)
    assert [name for name in enabled if not made[name].isEnabled()] == []
    assert [name for name in disabled if made[name].isEnabled()] == []


def test_facts_are_those_of_the_state(card):
    def of(state: ExplorerState) -> set[Fact]:
        return va.facts(
            state, is_at_rest=False, is_calm=False, can_undo=False, can_redo=False, can_go_on=False
        )

    assert of(ExplorerState()) == set()
    assert of(opened(ExplorerState(), card)) == {Fact.ATLAS}
    assert va.facts(
        ExplorerState(), is_at_rest=True, is_calm=True, can_undo=True, can_redo=True, can_go_on=True
    ) == {
        Fact.CALM,
        Fact.LEFT,
        Fact.REST,
        Fact.PAST,
        Fact.FUTURE,
    }


def test_a_command_acts_on_the_window_it_was_made_for(parent):
    window, other = Mock(), Mock()
    made = va.make_actions(COMMANDS, window, parent)
    va.make_actions(COMMANDS, other, parent)
    made["layout full shape"].trigger()
    made["theme dark"].trigger()
    made["from above"].trigger()
    made["export"].trigger()
    window.layout_requested.emit.assert_called_once_with(Layout.FULL_SHAPE)
    window.theme_requested.emit.assert_called_once_with(ThemeChoice.DARK)
    window.shapes.look_from.assert_called_once_with("above")
    window.ask_export.assert_called_once_with()
    assert other.mock_calls == []


def test_of_a_group_one_is_chosen_and_a_switch_stands_alone(parent):
    made = va.make_actions(COMMANDS, Mock(), parent)
    for name in ("layout full shape", "theme dark", "patients", "layout fit"):
        made[name].trigger()
    chosen = [name for name, action in made.items() if action.isChecked()]
    assert chosen == ["layout fit", "patients", "theme dark"]
    assert not made["undo"].isCheckable()


def test_a_new_command_is_one_value_and_its_name_in_a_menu(parent):
    done: list[object] = []
    new = Command("fly", "Fly…", done.append, keys=("Ctrl+F",), needs=frozenset({Fact.ATLAS}))
    window, menu = Mock(), QMenu(parent)
    made = va.make_actions((*COMMANDS, new), window, parent)
    va.fill(menu, ("about", SEPARATOR, "fly"), made)
    assert [action.text() for action in menu.actions()] == ["About", "", "Fly…"]
    assert menu.actions()[1].isSeparator()
    assert menu.actions()[2].toolTip() == "Fly (Ctrl+F)"
    menu.actions()[2].trigger()
    assert done == [window]


def test_every_command_finds_what_it_needs_in_the_real_window(qtbot, monkeypatch):
    """Dialogs are answered by nobody; what is emitted reaches nobody."""
    for ask in ("open_path", "scan_path", "image_path", "session_path", "session_place"):
        monkeypatch.setattr(f"naisr_viewer.views.main_window.ask_{ask}", lambda *_: None)
    window = MainWindow()
    qtbot.addWidget(window)
    for command in COMMANDS:
        if command.name not in ("export", "quit"):  # needs an atlas; comes last
            command.act(window)
    of("quit").act(window)
    assert not window.isVisible()
