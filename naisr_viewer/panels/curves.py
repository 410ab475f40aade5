"""Which curves are asked for."""

from __future__ import annotations

from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.curves import CurveRequest
from naisr_viewer.state.drawer import Tab
from naisr_viewer.state.explorer import ExplorerState

PLACES_APART = 2
"""Between so many pinned places there is a distance."""


def covariate_of(state: ExplorerState) -> str:
    """Along which covariate: the chosen one, else the one moved last; there is an atlas with some."""
    assert state.atlas is not None
    names = [each.name for each in state.atlas.covariates]
    wanted = (each for each in (state.curve.covariate, state.touched) if each in names)
    return next(wanted, names[0])


def curve_request(state: ExplorerState) -> CurveRequest | None:
    """What is to be asked for the drawer; None where it shows no curve."""
    if state.atlas is None or state.drawer is not Tab.CURVE:
        return None
    name = covariate_of(state)
    return CurveRequest(
        state.atlas.path,
        name,
        tuple((other, value) for other, value in state.heard if other != name),
        state.person if state.can_forecast else 0,
        state.pins[:PLACES_APART] if len(state.pins) >= PLACES_APART else (),
    )


def can_judge(atlas: AtlasCard) -> bool:
    """Whether it can be known what is usual among the people of an atlas."""
    return atlas.is_tabulated and atlas.population.tells_what_is_usual


def wants_norms(state: ExplorerState) -> bool:
    """Whether anything on screen is compared with what is usual, or told with how sure it is by that."""
    if state.atlas is None or not can_judge(state.atlas):
        return False
    return state.can_forecast or state.drawer is Tab.CURVE or (state.drawer is Tab.POINT and bool(state.pins))
