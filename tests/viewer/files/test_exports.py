"""What an export is named, and whether it meets files that are there."""

from __future__ import annotations

from dataclasses import replace

import pytest

from naisr_viewer.files.exports import file_stem, in_the_way, planned
from naisr_viewer.panels.kinds import panels_in
from naisr_viewer.state.explorer import ExplorerState, opened, with_value, with_values
from naisr_viewer.state.layouts import FULL_SHAPE, TEMPLATE, Layout, Panel
from naisr_viewer.state.requests import ExportChoice, SurfaceRequest
from naisr_viewer.words.names import seen_stem

VALUES = (("age", 150.0), ("weight", 34.5), ("sex", 1.0))


@pytest.fixture
def state(card) -> ExplorerState:
    return opened(ExplorerState(), card)


def test_a_name_tells_the_values_it_was_made_at(card):
    def stem(panel: Panel, *values: tuple[str, float]) -> str:
        return file_stem(card, SurfaceRequest(card.path, panel, values, 64))

    assert stem(TEMPLATE) == "ellipsoid-template"
    assert stem(Panel("effect", "age"), ("age", 20.0)) == "ellipsoid-age-only_age20"
    assert stem(FULL_SHAPE, *VALUES) == "ellipsoid-full-shape_age150_weight34.5_sexM"
    assert stem(FULL_SHAPE, ("sex", -1.0)) == "ellipsoid-full-shape_sexF"
    assert stem(FULL_SHAPE, ("sex", 0.5)) == "ellipsoid-full-shape_sex0.5"


def test_a_change_names_the_average_that_it_is_counted_from(card):
    request = SurfaceRequest(card.path, Panel("change"), VALUES, 64, 1, before=(0, VALUES))
    values = "age150_weight34.5_sexM"
    assert file_stem(card, request) == f"ellipsoid-change_{values}_since-average_{values}"


def test_two_values_of_one_slider_make_two_files(state, tmp_path):
    choice = ExportChoice((FULL_SHAPE,), "stl", 64, tmp_path)
    first, second = (planned(with_value(state, "age", age), choice)[0].path for age in (50.0, 50.5))
    assert first != second


def test_no_two_views_of_one_export_meet(state, card, tmp_path):
    plan = planned(state, ExportChoice(panels_in(Layout.SIDE_BY_SIDE, card), "ply", 64, tmp_path))
    assert len({each.path for each in plan}) == len(plan) == 5


def test_views_whose_names_would_be_the_same_are_numbered(card, tmp_path):
    twins = tuple(replace(card.covariates[0], name=name) for name in ("age", "Age", "a/b", "a:b"))
    strange = opened(ExplorerState(), replace(card, covariates=twins))
    panels = tuple(Panel("effect", each.name) for each in twins)
    plan = planned(strange, ExportChoice(panels, "ply", 64, tmp_path))
    assert len({each.path.name.lower() for each in plan}) == len(plan) == 4


def test_a_long_name_is_shortened_and_stays_its_own(card):
    def stem(age: float) -> str:
        covariate = replace(card.covariates[0], name="ä" * 200)
        request = SurfaceRequest(card.path, FULL_SHAPE, ((covariate.name, age),), 64)
        return file_stem(replace(card, covariates=(covariate,)), request)

    assert len(stem(10.0).encode()) < 200 and stem(10.0) != stem(20.0)


@pytest.mark.parametrize("name", ["../../etc", "a/b", "Wirbel säule", 'x"y', "a:b*c?", "{x} <b>"])
def test_no_name_leaves_the_folder(state, card, tmp_path, name):
    strange = replace(card, name=name)
    stem = file_stem(strange, SurfaceRequest(card.path, FULL_SHAPE, (("age", 1.0),), 64))
    path = tmp_path / f"{stem}.stl"
    path.write_text("x")
    assert path in tmp_path.iterdir()
    assert not set(' <>:"/\\|?*{}') & set(stem)


def test_meshes_and_records_that_are_there_are_in_the_way(state, tmp_path):
    plan = planned(state, ExportChoice((TEMPLATE, FULL_SHAPE), "stl", 64, tmp_path))
    assert in_the_way(plan) == []
    (tmp_path / "ellipsoid-template.stl.json").write_text("{}")
    (tmp_path / "another.stl").write_text("")
    assert [file.name for file in in_the_way(plan)] == ["ellipsoid-template.stl.json"]


def test_a_picture_is_named_after_what_is_seen(card):
    state = with_values(opened(ExplorerState(), card), (("age", 120.0), ("sex", 1.0)))
    weight = dict(state.named)["weight"]
    assert seen_stem(state, has_values=True) == f"ellipsoid_age120_weight{weight:.4g}_sexM"
    assert seen_stem(state, "session") == "ellipsoid-session"
    assert seen_stem(ExplorerState()) == "atlas"
