"""What the drawer beneath the shapes holds."""

from __future__ import annotations

from enum import StrEnum

from naisr_viewer.state.atlas_card import AtlasCard


class Tab(StrEnum):
    """One page of the drawer."""

    POINT = "point"
    CURVE = "curve"


def tabs_of(atlas: AtlasCard) -> tuple[Tab, ...]:
    """The pages that have something to tell of an atlas."""
    if not atlas.capabilities.trackable:
        return ()
    return tuple(tab for tab in Tab if tab is not Tab.CURVE or atlas.covariates)
