"""What covariates do to the surfaces of the shape model, as colours on them."""

from __future__ import annotations

from naisr_model.covariates import Covariate
from naisr_viewer.panels.base import Numbers, numbers
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.overlay import Map, Quantity
from naisr_viewer.words.maps import HINTS, rate_unit, told
from naisr_viewer.words.numbers import in_unit


def can_map(atlas: AtlasCard) -> bool:
    """Whether it is known what each covariate does to a material point."""
    return atlas.capabilities.trackable and atlas.capabilities.disentangleable and bool(atlas.covariates)


def can_mute(atlas: AtlasCard) -> bool:
    """Whether a covariate can be left out: it moves nothing at its centre, and is not the only one."""
    capabilities = atlas.capabilities
    return capabilities.vanishes_at_centre and capabilities.disentangleable and len(atlas.covariates) > 1


def map_of(state: ExplorerState, covariate: str = "") -> Map | None:
    """What a surface is coloured by; None where it is plain.

    Args:
        state: the situation.
        covariate: whose effect the surface is; left out, that of all of them, whose rate is of the one that
            was moved last.
    """
    quantity = state.overlay.quantity
    if quantity is Quantity.PLAIN or state.atlas is None or not can_map(state.atlas):
        return None
    if quantity is Quantity.DISPLACEMENT:
        return Map(quantity)
    return Map(quantity, covariate or state.touched or state.atlas.covariates[0].name)


def numbers_of(atlas: AtlasCard, shown: Map) -> Numbers:
    """What the numbers of a map are: ``displacement_mm``, ``rate_of_age_mm_per_month``."""
    meaning = in_unit(HINTS[shown.quantity], atlas.frame.unit)
    if shown.quantity is Quantity.DISPLACEMENT:
        return numbers("displacement", atlas.frame.unit, meaning)
    covariate = covariate_of(atlas, shown)
    kind = "contrast" if covariate.kind == "binary" else "rate"
    return numbers(f"{kind}_of_{covariate.name}", rate_unit(covariate, atlas.frame.unit), meaning)


def covariate_of(atlas: AtlasCard, shown: Map) -> Covariate:
    """What a rate is of."""
    return atlas.covariates[atlas.index(shown.covariate)]


def words_of_maps(state: ExplorerState) -> str:
    """What the numbers on the full shape are of, where that is a choice."""
    shown = map_of(state)
    if shown is None or state.atlas is None or not shown.covariate:
        return ""
    return told(covariate_of(state.atlas, shown), state.atlas.frame.unit)
