"""Places where the truth of a population is known."""

from __future__ import annotations

import dataclasses

import pytest
from eggs import egg

from naisr_model.atlas import Atlas
from naisr_model.evaluation.held_out import opened
from naisr_model.evaluation.truth import beside_truth, plausible_values, truth_places
from naisr_model.models.factory import model_class
from naisr_model.shipped import shipped_atlas


def test_places_lie_along_growth_along_each_covariate_and_at_the_centre(egg_people):
    atlas = opened(egg_people.atlas)
    places = truth_places(atlas)
    assert [place.values["age"] for place in places["growth"]] == [3.0, 7.0]
    assert {place.condition for place in places["growth"]} == {"hens"}
    centre = atlas.population.centre
    for place in places["effects"]:
        others = [name for name in centre if name != place.covariate]
        assert all(place.values[name] == centre[name] for name in others)
    assert [place.values for place in places["template"]] == [centre]


@pytest.mark.parametrize("lacking", ["has_template", "vanishes_at_centre"])
def test_the_shape_at_the_centre_is_called_the_template_only_where_it_is(egg_people, monkeypatch, lacking):
    atlas = Atlas.load(egg_people.atlas)
    own = dataclasses.replace(atlas.capabilities, **{lacking: False})
    monkeypatch.setattr(model_class(atlas.checkpoint.preset.model), "capabilities", own)
    places = truth_places(atlas)
    assert places["template"] == [] and places["growth"] and places["effects"]


def test_the_truth_is_without_individual_variation(egg_people):
    atlas = opened(egg_people.atlas)
    place = truth_places(atlas)["growth"][0]
    point = beside_truth(atlas, place, 64)
    assert point.truth_cm3 == pytest.approx(egg(3.0, -1.0).volume / 1000)
    assert point.volume_cm3 == pytest.approx(atlas.shape(place.values, resolution=64).volume / 1000)
    assert point.volume_error == pytest.approx(point.volume_cm3 / point.truth_cm3 - 1)
    assert 0 < point.hd_x100 < 30


def test_real_data_have_no_places(egg_atlas):
    assert not any(truth_places(Atlas.load(egg_atlas)).values())


def test_effects_are_judged_only_where_somebody_is():
    atlas = Atlas.load(shipped_atlas())
    age, weight, sex = atlas.covariates
    ages = plausible_values(atlas.population, age)
    # Nobody of a few months or of nineteen years has the cohort's mean weight.
    assert age.range[0] + 40 < min(ages) < age.centre < max(ages) < age.range[1] - 40
    assert all(
        weight.range[0] < value < weight.range[1] for value in plausible_values(atlas.population, weight)
    )
    assert plausible_values(atlas.population, sex) == [-1, 1]
