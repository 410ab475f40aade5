"""In which surfaces pinned places are found."""

from __future__ import annotations

from naisr_viewer.panels.kinds import kind_of, request_for, visible_panels
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.layouts import FULL_SHAPE, Panel
from naisr_viewer.state.pins import LedgerRequest, Shown


def can_pin(state: ExplorerState, panel: Panel) -> bool:
    """Whether a click on a surface means a material point, whose way can be told cause by cause."""
    return state.atlas is not None and state.atlas.capabilities.trackable and _has_pins(panel)


def ledger_request(state: ExplorerState) -> LedgerRequest | None:
    """What is to be asked about the pins; None where there are none."""
    if state.atlas is None or not state.pins:
        return None
    others = [each for each in visible_panels(state) if each != FULL_SHAPE and _has_pins(each)]
    return LedgerRequest(
        state.atlas.path,
        state.pins,
        _shown(state, FULL_SHAPE),
        tuple(_shown(state, panel) for panel in others),
        state.has_norms,
    )


def _has_pins(panel: Panel) -> bool:
    """A cell of the matrix is clicked for its covariates, and a fold in one would leave all without pins."""
    return kind_of(panel).is_modelled and panel.cell is None


def _shown(state: ExplorerState, panel: Panel) -> Shown:
    request = request_for(state, panel, 0)
    return Shown(panel, request.values, request.person)
