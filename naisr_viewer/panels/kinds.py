"""All kinds of views, in the order in which they stand on screen, and what follows from that."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from naisr_viewer.panels import (
    before,
    change,
    deviation,
    effect,
    matrix,
    scan,
    scans,
    shape,
    template,
    uncertainty,
    unusual,
)
from naisr_viewer.panels.base import PanelKind
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.layouts import FULL_SHAPE, Layout, Panel
from naisr_viewer.state.requests import SurfaceRequest, SurfaceResult
from naisr_viewer.words.captions import Caption
from naisr_viewer.words.numbers import in_unit
from naisr_viewer.words.titles import label

KINDS: dict[str, PanelKind] = {
    kind.name: kind
    for kind in (
        template.KIND,
        effect.KIND,
        before.KIND,
        shape.KIND,
        scan.KIND,
        uncertainty.KIND,
        deviation.KIND,
        unusual.KIND,
        change.KIND,
        scans.KIND,
        matrix.KIND,
    )
}
"""By name. A new kind is one line here and one among the answers of the engine; a script may add its own to
both before it makes a window."""


def kind_of(panel: Panel) -> PanelKind:
    """What a panel says of itself."""
    return KINDS[panel.kind]


def title_of(panel: Panel) -> str:
    """What stands above a sub-plot."""
    return kind_of(panel).title.format(covariate=label(panel.covariate))


def hint_of(panel: Panel, atlas: AtlasCard) -> str:
    """What a sub-plot is, for who hovers over its title."""
    return in_unit(kind_of(panel).hint, atlas.frame.unit)


def unit_of(panel: Panel, atlas: AtlasCard) -> str:
    """Of the numbers on its surface."""
    return in_unit(kind_of(panel).unit, atlas.frame.unit)


def caption_of(state: ExplorerState, result: SurfaceResult) -> Caption:
    """What stands beneath a result."""
    assert state.atlas is not None
    told = kind_of(result.request.panel).caption(state, result)
    return Caption(told.text, in_unit(told.hint, state.atlas.frame.unit))


def all_panels(atlas: AtlasCard) -> tuple[Panel, ...]:
    """Whatever an atlas can show."""
    return tuple(panel for kind in KINDS.values() for panel in kind.panels(atlas))


def panels_in(layout: Layout, atlas: AtlasCard) -> tuple[Panel, ...]:
    """What an atlas shows in a layout, in the order on screen."""
    return tuple(panel for panel in all_panels(atlas) if layout in kind_of(panel).layouts)


def layouts_of(atlas: AtlasCard) -> tuple[Layout, ...]:
    """The layouts in which an atlas has more to show than its full shape, and that one."""
    little = ((), (FULL_SHAPE,))
    return tuple(each for each in Layout if each is Layout.FULL_SHAPE or panels_in(each, atlas) not in little)


def with_layout_of(state: ExplorerState) -> ExplorerState:
    """``state`` in a layout that there is for its atlas."""
    if state.atlas is None or state.layout in layouts_of(state.atlas):
        return state
    return replace(state, layout=Layout.FULL_SHAPE)


def visible_panels(state: ExplorerState) -> tuple[Panel, ...]:
    """The panels of the present layout; none without an atlas."""
    if state.atlas is None:
        return ()
    return tuple(panel for panel in panels_in(state.layout, state.atlas) if is_there(state, panel))


def is_there(state: ExplorerState, panel: Panel) -> bool:
    """Whether ``state`` has a place for a panel, in whichever layout."""
    return kind_of(panel).is_there(state, panel)


def request_for(state: ExplorerState, panel: Panel, resolution: int) -> SurfaceRequest:
    """The surface that ``panel`` shows in ``state``; there is an atlas."""
    return kind_of(panel).ask(state, panel, resolution)


def shows(result: SurfaceResult | None, request: SurfaceRequest) -> bool:
    """Whether ``result`` shows what ``request`` asks for, at least as finely."""
    if result is None or result.request.resolution < request.resolution:
        return False
    return replace(result.request, resolution=request.resolution) == request


def missing(
    state: ExplorerState, shown: Mapping[Panel, SurfaceResult], resolution: int
) -> list[SurfaceRequest]:
    """What ``state`` wants at ``resolution`` and is not among ``shown`` yet.

    The full shape first, and of the matrix what is nearest to it.
    """
    last_first = visible_panels(state)[::-1]
    panels = sorted(last_first, key=lambda panel: kind_of(panel).away(state, panel))
    wanted = [request_for(state, panel, resolution) for panel in panels]
    return [request for request in wanted if not shows(shown.get(request.panel), request)]
