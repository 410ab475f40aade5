"""The shape that changes are counted from."""

from naisr_viewer.panels.base import PanelKind, asked, caption_of
from naisr_viewer.panels.shape import enclosed
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.layouts import Layout, Panel
from naisr_viewer.state.requests import SurfaceRequest


def _ask(state: ExplorerState, panel: Panel, resolution: int) -> SurfaceRequest:
    reference = state.reference
    if reference is None:
        return asked(state, panel, resolution, (), state.person)
    person, values = reference
    return asked(state, panel, resolution, values, person)


KIND = PanelKind(
    name="before",
    title="Before",
    hint="The shape that changes are counted from.",
    layouts=frozenset({Layout.CHANGE}),
    ask=_ask,
    caption=caption_of(enclosed),
    colour="#a3b4d2",
    is_possible=lambda atlas: atlas.capabilities.trackable,
)
