"""The colours of what is shown: covariates, shapes, scans and scales."""

from __future__ import annotations

from naisr_viewer.state.explorer import AtlasCard, Panel
from naisr_viewer.views.theme import Theme

TEMPLATE_COLOUR = "#a7adb8"
SHAPE_COLOUR = "#6f9fe8"
BEFORE_COLOUR = "#a3b4d2"
SCAN_COLOUR = "#b9b2a6"
COVARIATE_COLOURS = ("#e29a3b", "#4fae86", "#c0699f", "#46a9bd", "#d0694f", "#8f7fd6", "#a7a042", "#7f8ea6")
"""Told apart by colour-blind eyes as far as eight colours can be; repeated beyond eight."""

SIGNED_COLOURS = (
    "#2957a8", "#4379c4", "#6b9bd3", "#9bb9d8", "#d1d5d8", "#d7b092", "#d3885a", "#c55f28", "#aa3600",
)  # fmt: skip
"""From minus to plus the limit, with nothing in the middle: equal steps to the eye (in OKLab), and told
apart by colour-blind ones, because the ends differ in blueness."""

UNSIGNED_COLOURS = (
    "#e1e1bb", "#b9d0a8", "#8dbf9f", "#60ad9e", "#3598a0", "#1881a1", "#22689e", "#354d94", "#423182",
)  # fmt: skip
"""From nothing to the limit: equal steps to the eye (in OKLab), darker at each."""


def covariate_colour(atlas: AtlasCard, name: str) -> str:
    """The colour of a covariate, everywhere."""
    return COVARIATE_COLOURS[atlas.index(name) % len(COVARIATE_COLOURS)]


def panel_colour(atlas: AtlasCard, panel: Panel) -> str:
    """The colour of a panel's surface, where its vertices have none of their own."""
    if panel.kind == "effect":
        return covariate_colour(atlas, panel.covariate)
    plain = {"template": TEMPLATE_COLOUR, "scan": SCAN_COLOUR, "before": BEFORE_COLOUR}
    return plain.get(panel.kind, SHAPE_COLOUR)


def ghost_colour(theme: Theme) -> str:
    """What lies translucent over a shape: grey that is told from the shape's colour and from the ground."""
    return "#c3c8cf" if theme.is_dark else "#454b55"


def scale_colours(is_signed: bool) -> tuple[str, ...]:
    """The colours of a scale at equal distances from its low to its high end."""
    return SIGNED_COLOURS if is_signed else UNSIGNED_COLOURS
