"""The full shape, Phi."""

from naisr_viewer.panels.base import PanelKind, asked, caption_of
from naisr_viewer.panels.maps import map_of
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.layouts import FULL_SHAPE, Layout, Panel
from naisr_viewer.state.requests import SurfaceRequest, SurfaceResult
from naisr_viewer.words.captions import LATER, Caption, large
from naisr_viewer.words.maps import without
from naisr_viewer.words.numbers import volume

COLOUR = "#6f9fe8"


def enclosed(atlas: AtlasCard, result: SurfaceResult) -> Caption:
    """The volume of a surface or the area of a curve, with the margin of a person's."""
    later = LATER if result.request.values else ""
    within = "" if result.extent_margin is None else f", ± half of its 95 % interval.{later}"
    extent = atlas.frame.extent
    told = volume(result.extent, result.extent_margin, extent)
    return Caption(large(told), f"Enclosed {extent.title}{within}")


_MEASURED = caption_of(enclosed)


def _ask(state: ExplorerState, panel: Panel, resolution: int) -> SurfaceRequest:
    return asked(state, panel, resolution, state.heard, state.person, shown=map_of(state))


def _caption(state: ExplorerState, result: SurfaceResult) -> Caption:
    told = _MEASURED(state, result)
    return Caption(f"{told.text}<br>{without(state.muted)}", told.hint) if state.muted else told


KIND = PanelKind(
    name=FULL_SHAPE.kind,
    title="Full shape",
    hint="The shape at all covariates together.",
    layouts=frozenset(Layout) - {Layout.MATRIX},
    ask=_ask,
    caption=_caption,
    colour=COLOUR,
    is_mapped=True,
)
