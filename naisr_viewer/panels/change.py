"""How far the full shape has moved since the one that changes are counted from."""

from naisr_viewer.panels import shape
from naisr_viewer.panels.base import PanelKind, asked, caption_of
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.layouts import Layout, Panel
from naisr_viewer.state.requests import SurfaceRequest, SurfaceResult
from naisr_viewer.words.captions import LATER, Caption, beyond, large
from naisr_viewer.words.numbers import gained

HINT = (
    "How far the surface has moved along its normal since “before”, in mm, point by point: "
    f"positive where it has moved outwards.{LATER}"
)
DOUBTFUL = Caption(
    "correspondence uncertain",
    "The deformation folds here, so which point of the earlier surface belongs to one of the later is "
    "unsure.",
)


def _ask(state: ExplorerState, panel: Panel, resolution: int) -> SurfaceRequest:
    return asked(state, panel, resolution, state.named, state.person, state.reference)


def _gain(atlas: AtlasCard, result: SurfaceResult) -> Caption:
    if result.extent_before is None or result.colouring is None:
        return Caption(large("…"), HINT)
    text = gained(result.extent, result.extent_before, result.extent_margin, atlas.frame.extent)
    share = beyond(result.colouring).removeprefix(" · ")
    return Caption(large(text) + (f"<br>{share}" if share else ""), HINT)


KIND = PanelKind(
    name="change",
    title="Change",
    hint=(
        "The full shape, coloured by how far it has moved since “before” in mm:\n"
        "orange where it moved outwards (+), blue where it moved inwards (−)."
    ),
    layouts=frozenset({Layout.CHANGE}),
    ask=_ask,
    caption=caption_of(_gain, DOUBTFUL),
    colour=shape.COLOUR,
    scale="signed",
    is_possible=lambda atlas: atlas.capabilities.trackable,  # which point moved where
)
