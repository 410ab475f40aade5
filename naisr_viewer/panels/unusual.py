"""Where a fitted patient is as hardly anyone of the same covariates."""

from dataclasses import replace

import numpy as np

from naisr_viewer.panels import shape
from naisr_viewer.panels.base import PanelKind, ask_full_shape, caption_of
from naisr_viewer.panels.curves import can_judge
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.layouts import Layout, Panel
from naisr_viewer.state.requests import SurfaceRequest, SurfaceResult
from naisr_viewer.words.captions import LATER, Caption, beyond, large

HINT = (
    "Share of the surface that lies outside the band in which 95 % of people of the same covariates have "
    "theirs; the colours tell how far beyond it, in standard deviations of these people there. Of somebody "
    "like everybody it is about 5 %."
)
COMING = "It is being worked out what is usual among the people behind the atlas."


def _ask(state: ExplorerState, panel: Panel, resolution: int) -> SurfaceRequest:
    return replace(ask_full_shape(state, panel, resolution), is_judged=state.has_norms)


def _share(_atlas: AtlasCard, result: SurfaceResult) -> Caption:
    if result.colouring is None:
        return Caption(large("…"), HINT if result.request.is_judged else COMING)
    share = 100 * float(np.mean(result.colouring.values != 0))
    told = f"<br>outside the 95 % band{beyond(result.colouring)}"
    return Caption(large(f"{share:.0f} %") + told, HINT + LATER)


KIND = PanelKind(
    name="unusual",
    title="Unusual places",
    hint=(
        "The full shape, coloured by how far it lies beyond the band in which 95 % of people of the same\n"
        "covariates have their surface, in standard deviations (SD) of theirs: orange outside (+),\n"
        "blue inside (−), grey within the band."
    ),
    layouts=frozenset({Layout.FIT}),
    ask=_ask,
    caption=caption_of(_share),
    colour=shape.COLOUR,
    scale="signed",
    unit="SD",
    quantity="outside_band",
    is_possible=can_judge,
)
