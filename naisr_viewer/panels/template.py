"""The template: the shape that all others are made from."""

from naisr_viewer.panels.base import PanelKind, asked, caption_of
from naisr_viewer.panels.shape import enclosed
from naisr_viewer.state.layouts import TEMPLATE, Layout

KIND = PanelKind(
    name=TEMPLATE.kind,
    title="Template",
    hint="The shape from which all others are made.",
    layouts=frozenset({Layout.SIDE_BY_SIDE}),
    ask=lambda state, panel, resolution: asked(state, panel, resolution, (), 0),
    caption=caption_of(enclosed),
    colour="#a7adb8",
    is_possible=lambda atlas: atlas.capabilities.has_template,
)
