"""What a kind of view may rely on when it is answered."""

from __future__ import annotations

from dataclasses import replace

from naisr_viewer.engine.answers.base import Answer, simplest
from naisr_viewer.engine.answers.kinds import ANSWERS
from naisr_viewer.state.layouts import FULL_SHAPE, TEMPLATE, Panel
from naisr_viewer.state.requests import SurfaceRequest

AGED = (("age", 150.0), ("weight", 35.0), ("sex", 0.0))


def test_a_kind_of_one_s_own_is_asked_its_own_question(engine, card, monkeypatch):
    """Even where the model would show another panel's surface for the same values."""
    asked: list[SurfaceRequest] = []

    def give(source, request, progress):
        asked.append(request)
        return replace(source.surface(replace(request, panel=FULL_SHAPE), progress), request=request)

    monkeypatch.setitem(ANSWERS, "mine", Answer(give))
    request = SurfaceRequest(card.path, Panel("mine"), AGED, 128)
    assert engine.surface(request).request == request
    assert asked == [request]


def test_surfaces_are_shared_only_where_the_model_makes_them_equal(card):
    request = SurfaceRequest(card.path, FULL_SHAPE, AGED, 128)
    assert simplest(request, card).panel == Panel("effect", "age")
    at_centre = replace(request, values=(("age", 100.0),))
    assert simplest(at_centre, card).panel == TEMPLATE
    for lacking in ("vanishes_at_centre", "disentangleable"):
        other = replace(card, capabilities=replace(card.capabilities, **{lacking: False}))
        assert simplest(request, other) == request and simplest(at_centre, other) == at_centre
