"""What the cells of the matrix ask for, and what stands around them."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from naisr_viewer.panels.kinds import (
    caption_of,
    layouts_of,
    missing,
    request_for,
    visible_panels,
    with_layout_of,
)
from naisr_viewer.panels.matrix import here, is_pale
from naisr_viewer.state.explorer import ExplorerState, opened, with_value
from naisr_viewer.state.layouts import Layout, Panel
from naisr_viewer.state.matrix import with_covariate
from naisr_viewer.words.captions import lines_of
from naisr_viewer.words.matrix import heads, note


def at(column: int, row: int) -> Panel:
    return Panel("matrix", cell=(column, row))


@pytest.fixture
def state(card) -> ExplorerState:
    return replace(with_value(opened(ExplorerState(), card), "sex", 1.0), layout=Layout.MATRIX)


def test_cells_show_the_template_the_effects_and_the_full_shape_at_their_covariates(
    engine, atlas, card, state
):
    """The volumes of ellipsoids, whatever way the engine goes."""
    age, weight = state.matrix.across.values[3], state.matrix.down.values[0]
    told = {(0, 0): {}, (4, 0): {"age": age}, (0, 1): {"weight": weight}}
    told[4, 1] = {"age": age, "weight": weight, "sex": 1.0}
    engine.prepare_previews(card.path)
    for resolution in (40, 128):
        for cell, values in told.items():
            surface = engine.surface(request_for(state, at(*cell), resolution))
            assert surface.extent == pytest.approx(atlas.volume_cm3(**values), rel=0.01)
            assert surface.request.panel == at(*cell)


def test_a_cell_shares_its_surface_with_the_other_layouts(engine, atlas, state):
    own = engine.surface(request_for(state, at(2, 2), 128))
    atlas.calls.clear()
    age, weight = state.matrix.across.values[1], state.matrix.down.values[1]
    there = with_value(with_value(state, "age", age), "weight", weight)
    full = engine.surface(request_for(there, Panel("shape"), 128))
    assert atlas.calls == [] and full.points_mm is own.points_mm


def test_dragging_what_is_laid_out_asks_for_nothing_and_the_rest_for_all_but_the_axes(engine, state):
    shown = {panel: engine.surface(request_for(state, panel, 40)) for panel in visible_panels(state)}
    assert missing(with_value(state, "age", 3.0), shown, 40) == []
    asked = missing(with_value(state, "sex", -1.0), shown, 40)
    assert {request.panel.cell for request in asked} == {(c, r) for c in range(1, 5) for r in range(1, 4)}


def test_what_is_nearest_is_computed_first(card, state):
    age, weight = state.matrix.across.values[2], state.matrix.down.values[1]
    there = with_value(with_value(state, "age", age), "weight", weight)
    asked = missing(there, {}, 40)
    assert asked[0].panel == here(there) == at(3, 2) and len(asked) == 20

    def away(values: dict[str, float]) -> float:
        return math.hypot(
            *(
                (values.get(each.name, each.centre) - now) / each.scale
                for each, now in zip(card.covariates, there.values, strict=True)
            )
        )

    distances = [away(dict(request.values)) for request in asked]
    assert distances == pytest.approx(sorted(distances))


def test_the_words_say_what_each_cell_is(engine, card, state):
    def lines(column: int, row: int) -> tuple[str, ...]:
        return lines_of(caption_of(state, engine.surface(request_for(state, at(column, row), 40))))

    words = heads(card, state.matrix)
    assert words.across[0] == "Weight only" and words.down[0] == "Age only"
    assert words.across[1] == f"{state.matrix.across.values[0]:.0f} months"
    assert lines(0, 0)[1] == "template"
    assert lines(4, 1)[1] == "outside the data"  # the oldest at the weight of the youngest
    assert is_pale(state, at(4, 1)) and not is_pale(state, at(1, 1))
    assert len(lines(1, 1)) == 1
    assert note(state) == "Ellipsoid atlas, population average · Sex: M"


def test_a_binary_covariate_has_two_columns(card, state):
    by_sex = replace(state, matrix=with_covariate(card, state.matrix, "across", "sex"))
    assert visible_panels(by_sex) == tuple(at(column, row) for row in range(4) for column in range(3))
    assert heads(card, by_sex.matrix).across == ("Weight only", "F", "M")


def test_it_is_offered_where_effects_are_apart_and_there_are_two_of_them(card):
    assert Layout.MATRIX in layouts_of(card)
    joint = replace(card, capabilities=replace(card.capabilities, disentangleable=False))
    single = replace(card, covariates=card.covariates[:1])
    for other in (joint, single):
        assert Layout.MATRIX not in layouts_of(other)
        assert with_layout_of(ExplorerState(other, layout=Layout.MATRIX)).layout is Layout.FULL_SHAPE
