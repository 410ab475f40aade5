"""What the drawer beneath the shapes holds."""

from __future__ import annotations

from enum import StrEnum

from naisr_viewer.state.atlas_card import AtlasCard


class Tab(StrEnum):
    """One page of the drawer."""

    POINT = "point"


def tabs_of(atlas: AtlasCard) -> tuple[Tab, ...]:
    """The pages that have something to tell of an atlas."""
    return (Tab.POINT,) if atlas.capabilities.trackable else ()
