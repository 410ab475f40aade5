"""The colours of what is shown: covariates, shapes, scans and scales."""

from __future__ import annotations

from naisr_viewer.panels.kinds import kind_of, request_for, visible_panels
from naisr_viewer.panels.matrix import is_pale
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.layouts import Panel
from naisr_viewer.state.matrix import plain_panel
from naisr_viewer.state.requests import Scale
from naisr_viewer.views.theme import Theme

COVARIATE_COLOURS = ("#e29a3b", "#4fae86", "#c0699f", "#46a9bd", "#d0694f", "#8f7fd6", "#a7a042", "#7f8ea6")
"""Told apart by colour-blind eyes as far as eight colours can be; repeated beyond eight."""

PIN_COLOURS = ("#d6246e", "#1f6fd6", "#4b2a8c")
"""Of the first, second and third pinned place; told from the shapes and from one another."""

PALENESS = 0.6
"""Share of the ground in the colour of a surface that is a guess."""

PAPER = "#ffffff"
PATIENT_COLOURS = ("#d6453d", "#1f9e8c", "#7a5cd0", "#b07d10", "#c2479a", "#5f8a1e")
"""Of the patients that are open, wherever they are points among others; repeated beyond six."""

SCALE_COLOURS: dict[Scale, tuple[str, ...]] = {
    "signed": (
        "#2957a8", "#4379c4", "#6b9bd3", "#9bb9d8", "#d1d5d8", "#d7b092", "#d3885a", "#c55f28", "#aa3600",
    ),
    "unsigned": (
        "#e1e1bb", "#b9d0a8", "#8dbf9f", "#60ad9e", "#3598a0", "#1881a1", "#22689e", "#354d94", "#423182",
    ),
}  # fmt: skip
"""At equal distances from the low to the high end, equal steps to the eye (in OKLab). Signed ones have
nothing in the middle, and their ends differ in blueness, so that colour-blind eyes tell them apart; unsigned
ones are darker at each step."""


def covariate_colour(atlas: AtlasCard, name: str) -> str:
    """The colour of a covariate, everywhere."""
    return COVARIATE_COLOURS[atlas.index(name) % len(COVARIATE_COLOURS)]


def panel_colour(atlas: AtlasCard, panel: Panel) -> str:
    """The colour of a panel's surface, where its vertices have none of their own."""
    return kind_of(panel).colour or covariate_colour(atlas, panel.covariate)


def cell_colours(state: ExplorerState) -> dict[Panel, tuple[str, bool]]:
    """The colour of each cell of the matrix on screen, that of what it shows, and whether it is pale."""
    assert state.atlas is not None
    result = {}
    for panel in visible_panels(state):
        shown = plain_panel(request_for(state, panel, 0).values)
        result[panel] = panel_colour(state.atlas, shown), is_pale(state, panel)
    return result


def printed_colours(state: ExplorerState) -> dict[Panel, str]:
    """The same on white paper."""
    return {
        panel: blend(colour, PAPER, PALENESS if is_faint else 0.0)
        for panel, (colour, is_faint) in cell_colours(state).items()
    }


def blend(colour: str, other: str, share: float) -> str:
    """``colour`` (``#rrggbb``) with a share of another one."""
    pairs = ((int(colour[i : i + 2], 16), int(other[i : i + 2], 16)) for i in (1, 3, 5))
    return "#" + "".join(f"{round(own + share * (there - own)):02x}" for own, there in pairs)


def pin_colour(number: int) -> str:
    """The colour of a pinned place, on the shapes and where it is told of."""
    return PIN_COLOURS[(number - 1) % len(PIN_COLOURS)]


def patient_colour(key: int) -> str:
    """The colour of an open patient among others."""
    return PATIENT_COLOURS[(key - 1) % len(PATIENT_COLOURS)]


def ghost_colour(theme: Theme) -> str:
    """What lies translucent over a shape: grey that is told from the shape's colour and from the ground."""
    return "#c3c8cf" if theme.is_dark else "#454b55"
