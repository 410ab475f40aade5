"""What the user can tell the window to do: commands as values, from which menus and toolbar are made."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from enum import Enum, auto
from typing import Protocol

from PySide6.QtCore import QObject, Qt, SignalInstance
from PySide6.QtGui import QAction, QActionGroup, QKeySequence
from PySide6.QtWidgets import QMenu, QToolBar, QWidget

from naisr_model.shipped import ATLASES
from naisr_viewer.panels.kinds import layouts_of
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.drawer import Tab, tabs_of
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.layouts import Layout
from naisr_viewer.state.theme import ThemeChoice
from naisr_viewer.views.covariates.panel import CovariatePanel
from naisr_viewer.views.more_button import show_more_sign
from naisr_viewer.views.shapes.camera import DIRECTIONS
from naisr_viewer.views.shapes.shape_view import ShapeView


class Fact(Enum):
    """What may be so, and what commands may need to be so."""

    ATLAS = auto()  # an atlas is open
    REST = auto()  # nothing is being opened, fitted or exported
    FIT = auto()  # the patient that is shown has been fitted
    FORECAST = auto()  # and so well that it can be shown at other covariates
    PAST = auto()  # an act can be undone
    FUTURE = auto()  # one that was undone can be redone
    LEFT = auto()  # a session of an earlier run was kept
    PINS = auto()  # places are pinned
    CALM = auto()  # no computation can be stopped, so that Esc is free


class Window(Protocol):
    """What the commands act on."""

    covariates: CovariatePanel
    shapes: ShapeView
    going_on_requested: SignalInstance
    undo_requested: SignalInstance
    redo_requested: SignalInstance
    layout_requested: SignalInstance
    theme_requested: SignalInstance
    section_switched: SignalInstance
    edges_switched: SignalInstance
    picture_copy_requested: SignalInstance
    table_copy_requested: SignalInstance
    unpin_requested: SignalInstance
    play_requested: SignalInstance
    drawer_requested: SignalInstance
    about_requested: SignalInstance
    preferences_requested: SignalInstance

    def ask_atlas(self) -> None:
        """Let an atlas be chosen and opened."""

    def ask_scan(self) -> None:
        """Let a patient's file be chosen and opened."""

    def ask_session(self) -> None:
        """Let a session be chosen and opened."""

    def ask_session_place(self) -> None:
        """Let a place be chosen for the session."""

    def ask_export(self) -> None:
        """Let surfaces be chosen and written."""

    def ask_screenshot(self) -> None:
        """Let a place be chosen for a picture."""

    def open_example(self, name: str) -> None:
        """Open one of the atlases that come with the program."""

    def show_document(self, page: str) -> None:
        """Open one of the documents that come with the program."""

    def show_about_atlas(self) -> None:
        """Say who is behind the atlas that is open."""

    def show_keys(self) -> None:
        """Open the sheet of keys and mouse."""

    def show_sides(self) -> None:
        """Show the panels beside the shapes that are switched on."""

    def close(self) -> bool:
        """Close the window."""


@dataclass(frozen=True)
class Command:
    """One thing that can be told.

    Attributes:
        name: what menus and toolbar call it.
        text: what the user reads; with ``…`` where a dialog comes first.
        act: what is done.
        keys: shortcuts, the one that is shown first.
        tip: more than the text, on hover.
        needs: what must be so.
        offered: whether there is such a thing for an atlas; it is absent where not.
        group: of which one is chosen; empty for a command that stands alone.
        is_switch: whether it is on or off.
    """

    name: str
    text: str
    act: Callable[[Window], object]
    keys: tuple[str, ...] = ()
    tip: str = ""
    needs: frozenset[Fact] = frozenset()
    offered: Callable[[AtlasCard], bool] = lambda _: True
    group: str = ""
    is_switch: bool = False

    @property
    def hint(self) -> str:
        """What is told on hover, with the shortcut."""
        return f"{self.tip or self.text.rstrip('…')} ({self.keys[0]})" if self.keys else self.tip


OPEN = frozenset({Fact.ATLAS})
AT_REST = OPEN | {Fact.REST}


def _needed(layout: Layout) -> set[Fact]:
    if layout.is_forecast:
        return {Fact.FORECAST}
    return {Fact.FIT} if layout.needs_fit else set()


def _layout(layout: Layout, number: int) -> Command:
    return Command(
        f"layout {layout}",
        layout.capitalize(),
        lambda window: window.layout_requested.emit(layout),
        keys=(f"Ctrl+{number}",),
        needs=OPEN | _needed(layout),
        offered=lambda atlas: layout in layouts_of(atlas),
        group="layout",
    )


def _drawer(tab: Tab, keys: str, tip: str) -> Command:
    return Command(
        f"drawer {tab}",
        tab.capitalize(),
        lambda window: window.drawer_requested.emit(tab),
        keys=(keys,),
        tip=tip,
        needs=OPEN,
        offered=lambda atlas: tab in tabs_of(atlas),
        is_switch=True,
    )


def _is_in_space(atlas: AtlasCard) -> bool:
    """Curves in the plane have one side, no triangles and nothing to cut."""
    return not atlas.is_flat


def _look(direction: str, number: int) -> Command:
    return Command(
        f"from {direction}",
        f"From {direction}",
        lambda window: window.shapes.look_from(direction),
        keys=(f"Alt+{number}",),
        needs=OPEN,
        offered=_is_in_space,
    )


def _theme(choice: ThemeChoice) -> Command:
    return Command(
        f"theme {choice}",
        f"{choice.capitalize()} theme",
        lambda window: window.theme_requested.emit(choice),
        group="theme",
    )


def _document(title: str, page: str, *keys: str) -> Command:
    return Command(f"document {page}", title, lambda window: window.show_document(page), keys=keys)


def _example(name: str, title: str) -> Command:
    return Command(f"example {name}", title, lambda window: window.open_example(name), tip=f"Open {name}")


LAYOUTS = tuple(_layout(layout, number) for number, layout in enumerate(Layout, start=1))
DRAWER = (
    _drawer(Tab.POINT, "Ctrl+Shift+P", "What each covariate does to the places that are pinned"),
    _drawer(Tab.CURVE, "Ctrl+Shift+C", "How volume, length and other measures change along a covariate"),
)
LOOKS = tuple(_look(direction, number) for number, direction in enumerate(DIRECTIONS, start=1))
DOCUMENTS = (
    _document("User guide", "user-guide.md", "Shift+F1"),
    _document("Methods", "methods.md"),
    _document("Results", "results.md"),
    _document("Glossary", "glossary.md"),
    _document("Architecture", "architecture.md"),
)
EXAMPLES = tuple(_example(name, title) for name, title in ATLASES.items())
THEMES = tuple(_theme(choice) for choice in ThemeChoice)

COMMANDS = (
    Command(
        "open atlas",
        "Open atlas…",
        lambda window: window.ask_atlas(),
        keys=("Ctrl+O",),
        tip="Open another atlas",
    ),
    Command(
        "open scan",
        "Open scan…",
        lambda window: window.ask_scan(),
        keys=("Ctrl+Shift+O",),
        tip="Open a patient's shape to fit the atlas to it",
        needs=AT_REST,
    ),
    Command(
        "open session",
        "Open session…",
        lambda window: window.ask_session(),
        keys=("Ctrl+Alt+O",),
        tip="Bring back what a session had on screen",
    ),
    Command(
        "save session",
        "Save session…",
        lambda window: window.ask_session_place(),
        keys=("Ctrl+Shift+S",),
        tip="Keep all that is on screen, to bring it back",
        needs=AT_REST,
    ),
    Command(
        "go on",
        "Go on where you left",
        lambda window: window.going_on_requested.emit(),
        tip="Bring back what was on screen when the window was closed last",
        needs=frozenset({Fact.REST, Fact.LEFT}),
    ),
    Command(
        "export",
        "Export…",
        lambda window: window.ask_export(),
        keys=("Ctrl+E",),
        tip="Write surfaces to files",
        needs=AT_REST,
    ),
    Command(
        "screenshot",
        "Screenshot…",
        lambda window: window.ask_screenshot(),
        keys=("Ctrl+S",),
        tip="Save a picture of the window",
        needs=OPEN,
    ),
    Command("quit", "Quit", lambda window: window.close(), keys=("Ctrl+Q",)),
    Command(
        "undo",
        "Undo",
        lambda window: window.undo_requested.emit(),
        keys=("Ctrl+Z",),
        tip="Undo the last act: covariate, plane or pin; a scan opened, read, fitted, compared or closed",
        needs=frozenset({Fact.REST, Fact.PAST}),
    ),
    Command(
        "redo",
        "Redo",
        lambda window: window.redo_requested.emit(),
        keys=("Ctrl+Shift+Z", "Ctrl+Y"),
        tip="Redo what was undone",
        needs=frozenset({Fact.REST, Fact.FUTURE}),
    ),
    Command(
        "reset all",
        "Reset all covariates",
        lambda window: window.covariates.reset_all_requested.emit(),
        keys=("Ctrl+R",),
        needs=AT_REST,
        offered=lambda atlas: bool(atlas.covariates),
    ),
    Command(
        "copy picture",
        "Copy picture",
        lambda window: window.picture_copy_requested.emit(),
        keys=("Ctrl+Alt+P",),
        tip="Copy the shapes as a picture",
        needs=OPEN,
    ),
    Command(
        "copy table",
        "Copy table",
        lambda window: window.table_copy_requested.emit(),
        keys=("Ctrl+Alt+C",),
        tip="Copy covariates and volume or area of every view on screen, for a spreadsheet",
        needs=OPEN,
    ),
    Command(
        "unpin",
        "Remove pins",
        lambda window: window.unpin_requested.emit(),
        keys=("Esc",),
        tip="Remove the pinned places; a click on a shape pins one",
        needs=frozenset({Fact.PINS, Fact.CALM}),
        offered=lambda atlas: atlas.capabilities.trackable,
    ),
    Command(
        "preferences",
        "Preferences…",
        lambda window: window.preferences_requested.emit(),
        keys=("Ctrl+,",),
        tip="Choose what is asked before it is done",
    ),
    *LAYOUTS,
    Command(
        "patients",
        "Patients",
        lambda window: window.show_sides(),
        keys=("Ctrl+P",),
        tip="Show the patients",
        needs=OPEN,
        is_switch=True,
    ),
    *DRAWER,
    Command(
        "play",
        "Play",
        lambda window: window.play_requested.emit(),
        keys=("F5",),
        tip="Move the covariate that was moved last to and fro; again to stop",
        needs=AT_REST,
        is_switch=True,
        offered=lambda atlas: bool(atlas.covariates),
    ),
    Command(
        "section",
        "Section plane",
        lambda window: window.section_switched.emit(),
        keys=("Ctrl+K",),
        tip="Cut all shapes by one plane; again to have them whole",
        needs=AT_REST,
        is_switch=True,
        offered=_is_in_space,
    ),
    Command(
        "edges",
        "Triangles",
        lambda window: window.edges_switched.emit(),
        keys=("Ctrl+T",),
        tip="Draw the triangles that the surfaces are made of",
        needs=OPEN,
        is_switch=True,
        offered=_is_in_space,
    ),
    Command(
        "reset camera",
        "Reset camera",
        lambda window: window.shapes.reset_camera(),
        keys=("Ctrl+0",),
        tip="The view that an atlas opens with",
        needs=OPEN,
    ),
    *LOOKS,
    *THEMES,
    Command(
        "keys",
        "Keys and mouse",
        lambda window: window.show_keys(),
        keys=("F1",),
        tip="All keys, and what the mouse does",
    ),
    *DOCUMENTS,
    *EXAMPLES,
    Command(
        "about atlas",
        "About this atlas",
        lambda window: window.show_about_atlas(),
        tip="Who is behind the atlas, and what it can do",
        needs=OPEN,
    ),
    Command("about", "About", lambda window: window.about_requested.emit()),
)
"""All that can be told."""

SEPARATOR = ""
"""A line between entries."""

RECENT = "open recent"
"""The entry that opens a menu of files, which the window fills."""

EXAMPLE = "open example"
"""The entry that opens a menu of :data:`EXAMPLES`."""


def _names(commands: Sequence[Command]) -> tuple[str, ...]:
    return tuple(command.name for command in commands)


MENUS = {
    "&File": (
        "open atlas", "open scan", "open session", RECENT, "go on", SEPARATOR,
        "save session", "export", "screenshot", SEPARATOR, "quit",
    ),
    "&Edit": (
        "undo", "redo", SEPARATOR, "copy picture", "copy table", SEPARATOR,
        "reset all", "unpin", SEPARATOR, "preferences",
    ),
    "&View": (
        *_names(LAYOUTS), "patients", *_names(DRAWER), SEPARATOR,
        "play", "section", "edges", SEPARATOR, "reset camera", *_names(LOOKS), SEPARATOR, *_names(THEMES),
    ),
    "&Help": ("keys", *_names(DOCUMENTS), SEPARATOR, EXAMPLE, SEPARATOR, "about atlas", "about"),
}  # fmt: skip
"""What stands in the menu bar, by name."""

TOOLBAR = (
    "open atlas", "open scan", "export", SEPARATOR,
    *_names(LAYOUTS), SEPARATOR,
    "undo", "redo", "reset camera",
)  # fmt: skip
"""What stands in the toolbar, by name."""


def make_actions(commands: Sequence[Command], window: Window, parent: QObject) -> dict[str, QAction]:
    """What Qt shows of the commands, by name.

    Args:
        commands: what can be told.
        window: what they act on.
        parent: who owns the actions.
    """
    actions = {command.name: _action(command, window, parent) for command in commands}
    for group in sorted({command.group for command in commands if command.group}):
        choices = QActionGroup(parent)
        for command in commands:
            if command.group == group:
                choices.addAction(actions[command.name])
    return actions


def _action(command: Command, window: Window, parent: QObject) -> QAction:
    action = QAction(command.text, parent)
    action.triggered.connect(lambda _=False: command.act(window))
    action.setShortcuts([QKeySequence(keys) for keys in command.keys])
    action.setToolTip(command.hint)
    action.setCheckable(command.is_switch or bool(command.group))
    return action


def fill(target: QMenu | QToolBar, names: Sequence[str], actions: Mapping[str, QAction]) -> None:
    """Put the actions of these names into a menu or a toolbar, with lines between them."""
    for name in names:
        if name == SEPARATOR:
            target.addSeparator()
        else:
            target.addAction(actions[name])


def make_toolbar(actions: Mapping[str, QAction], parent: QWidget) -> QToolBar:
    """The toolbar, which stays where it is."""
    bar = QToolBar("Main", parent)
    bar.setMovable(False)
    bar.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextOnly)
    bar.setContextMenuPolicy(Qt.ContextMenuPolicy.PreventContextMenu)
    fill(bar, TOOLBAR, actions)
    show_more_sign(bar)
    return bar


def facts(
    state: ExplorerState, is_at_rest: bool, is_calm: bool, can_undo: bool, can_redo: bool, can_go_on: bool
) -> set[Fact]:
    """What is so, of all that commands may need."""
    holds = {
        Fact.ATLAS: state.atlas is not None,
        Fact.REST: is_at_rest,
        Fact.FIT: state.fit is not None,
        Fact.FORECAST: state.can_forecast,
        Fact.PAST: can_undo,
        Fact.FUTURE: can_redo,
        Fact.PINS: bool(state.pins),
        Fact.CALM: is_calm,
        Fact.LEFT: can_go_on,
    }
    return {fact for fact, is_so in holds.items() if is_so}


def enable(commands: Sequence[Command], actions: Mapping[str, QAction], so: AbstractSet[Fact]) -> None:
    """Enable the commands whose needs are met by what is so."""
    for command in commands:
        actions[command.name].setEnabled(command.needs <= so)


def offer(commands: Sequence[Command], actions: Mapping[str, QAction], atlas: AtlasCard) -> None:
    """Show the commands that there are for an atlas, and no others."""
    for command in commands:
        actions[command.name].setVisible(command.offered(atlas))
