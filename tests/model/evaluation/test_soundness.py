"""Whether shapes are sound, asked of the eggs, which are."""

from __future__ import annotations

import pytest
from eggs import egg

from naisr_model.atlas import Atlas
from naisr_model.evaluation.soundness import components, folded_share, mean_displacement_mm, surface_places


@pytest.fixture(scope="module")
def atlas(egg_atlas) -> Atlas:
    return Atlas.load(egg_atlas)


def test_surfaces_are_looked_at_where_data_are_and_at_the_corners(atlas):
    places = surface_places(atlas)
    training = int((~atlas.population.held_out).sum())
    assert len(places["plausible"]) == training + 18 * len(atlas.covariates)
    (age, sex) = atlas.covariates
    corners = {(values["age"], values["sex"]) for values in places["corners"]}
    assert corners == {(a, s) for a in age.range for s in sex.range}


def test_between_two_levels_nothing_is_asked_of_a_model_that_knows_nothing_there(egg_asdf):
    atlas = Atlas.load(egg_asdf)
    plausible = surface_places(atlas)["plausible"]
    assert {values["sex"] for values in plausible if "age" in values} == {-1.0, 1.0}
    assert all("sex" in values for values in plausible)


def test_an_egg_is_one_piece_without_folds(atlas):
    assert components(atlas, {"age": 5.0}, 64) == 1
    assert 0 <= folded_share(atlas) < 0.05


def test_displacements_are_measured_in_millimetres(atlas):
    lengths = mean_displacement_mm(atlas, egg(5.0, 1.0))
    assert lengths.keys() == {"age", "sex"}
    assert all(0 <= length < 5 for length in lengths.values())
