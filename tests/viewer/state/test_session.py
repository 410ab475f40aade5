"""What is kept of a situation, and what comes back of it."""

from __future__ import annotations

from dataclasses import replace

from naisr_viewer.state.curves import CurveChoice
from naisr_viewer.state.explorer import ExplorerState, opened
from naisr_viewer.state.session import session_of, state_of


def test_of_covariates_that_the_atlas_has_not_it_is_silent(card):
    state = replace(opened(ExplorerState(), card), muted=("sex", "age"), touched="weight")
    state = replace(state, curve=CurveChoice("length", "weight"))
    session = session_of(state, None, (1280, 800))
    assert state_of(session, card, ()) == state
    less = replace(card, covariates=tuple(each for each in card.covariates if each.name == "age"))
    there = state_of(session, less, ())
    assert (there.muted, there.touched, there.curve) == (("age",), "", CurveChoice())
