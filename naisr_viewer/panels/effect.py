"""The disentangled shape of one covariate, Phi_i."""

from naisr_viewer.panels.base import PanelKind, asked, caption_of
from naisr_viewer.panels.maps import map_of
from naisr_viewer.panels.shape import enclosed
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.layouts import Layout, Panel
from naisr_viewer.state.requests import SurfaceRequest


def _ask(state: ExplorerState, panel: Panel, resolution: int) -> SurfaceRequest:
    own = tuple(item for item in state.named if item[0] == panel.covariate)
    return asked(state, panel, resolution, own, state.person, shown=map_of(state, panel.covariate))


KIND = PanelKind(
    name="effect",
    title="{covariate} only",
    hint=(
        "The template moved by this covariate alone, all others at the population mean.\n"
        "Displacements add up at a point; the surfaces shown here do not add up to the full shape."
    ),
    layouts=frozenset({Layout.SIDE_BY_SIDE}),
    ask=_ask,
    caption=caption_of(enclosed),
    is_mapped=True,
    covariates=lambda atlas: tuple(covariate.name for covariate in atlas.covariates),
    is_possible=lambda atlas: atlas.capabilities.disentangleable,
)
