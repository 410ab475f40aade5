"""Fitting a shape: the truth is found again, and the intervals are honest."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from eggs import egg

from naisr_model.covariates import growth_path
from naisr_model.errors import Cancelled, InputError
from naisr_model.models.factory import model_class
from naisr_model.progress import Progress


def test_a_shape_of_the_atlas_is_found_again(atlas, made):
    values, _, shape = made
    fit = atlas.fit(shape, values)
    assert fit.covariates == pytest.approx(values) and fit.intervals == {} and len(fit.alternatives) == 1
    assert fit.residual_mm < 0.1
    assert np.abs(atlas.sdf(shape.vertices, values, fit.latent)).mean() < 0.1
    assert fit.volume_cm3 == pytest.approx(shape.volume / 1000, rel=0.02)


def test_unknown_covariates_are_inferred_with_their_intervals(atlas):
    fit = atlas.fit(egg(7.0, 1.0))
    low, high = fit.intervals["age"]
    assert low < 7 < high and high - low < 4
    assert fit.covariates["age"] == pytest.approx(7, abs=1)
    assert fit.covariates["sex"] == 1 and fit.intervals["sex"][1] == 1
    low, high = fit.volume_interval_cm3
    assert low < egg(7.0, 1.0).volume / 1000 < high
    low, high = fit.intervals["age"]
    assert set(fit.covariances) == {("age", "age")}  # and not of a level
    assert 1.96 * fit.covariances["age", "age"] ** 0.5 == pytest.approx((high - low) / 2, rel=0.2)
    known_age = atlas.fit(egg(7.0, 1.0), {"age": 7.0})
    assert known_age.covariances == {}
    assert set(known_age.intervals) == {"sex"} and known_age.covariates["sex"] == 1
    known_sex = atlas.fit(egg(7.0, 1.0), {"sex": 1.0})
    assert set(known_sex.intervals) == {"age"} and len(known_sex.alternatives) == 1


def test_covariances_are_of_all_explanations_together(atlas, made):
    """Against draws from the mixture, about the values of the more probable part."""
    fit, (age, sex) = atlas.fit(made[2], made[0]), atlas.covariates
    two = dataclasses.replace(age, name="two", scale=3.0)
    means, spreads = np.array([[0.3, -0.2, 1.0], [0.9, 0.5, -1.0]]), np.array([[0.2, 0.1], [0.1, 0.3]])
    explanations = tuple(
        dataclasses.replace(
            fit.results[0], covariates=mean, free=np.array([0, 1]), spread=(1 + k) * spreads, surprise=3.0 * k
        )
        for k, mean in enumerate(means)
    )
    individual = SimpleNamespace(atlas=SimpleNamespace(covariates=(age, two, sex)))
    found = dataclasses.replace(fit, individual=individual, results=explanations).covariances
    rng = np.random.default_rng(0)
    count = round(200_000 / (1 + np.exp(-1.5)))
    draws = np.vstack(
        [
            rng.multivariate_normal(means[0, :2], spreads, count),
            rng.multivariate_normal(means[1, :2], 2 * spreads, 200_000 - count),
        ]
    )
    offsets = (draws - means[0, :2]) * [age.scale, 3.0]
    expected = offsets.T @ offsets / len(offsets)
    for i, one in enumerate(("age", "two")):
        for j, other in enumerate(("age", "two")):
            assert found[one, other] == pytest.approx(expected[i, j], rel=0.02)


def test_the_same_shape_has_the_same_fit(atlas, made):
    first, second = (atlas.fit(made[2]) for _ in range(2))
    assert first.covariates == second.covariates and (first.latent == second.latent).all()


def test_part_of_a_surface_and_a_cloud_of_points_will_do(atlas, made):
    values, _, shape = made
    part = shape.copy()
    part.update_faces(part.triangles_center[:, 2] < part.vertices[:, 2].mean() + 10)
    assert not part.is_watertight
    for given in (part, shape.sample(400, seed=0)):
        fit = atlas.fit(given, values)
        assert np.abs(atlas.sdf(shape.vertices, values, fit.latent)).mean() < 0.3


def test_far_off_points_are_not_followed(atlas, made):
    values, _, shape = made
    points = np.concatenate([shape.sample(500, seed=0), np.full((60, 3), 25.0)])
    fit = atlas.fit(points, values)
    assert np.abs(atlas.sdf(shape.vertices, values, fit.latent)).mean() < 0.3


def test_what_is_unsure_of_a_person_hardly_shows_on_the_person_s_own_shape(atlas):
    person = atlas.fit(egg(7.0, 1.0)).individual
    as_elsewhere = dataclasses.replace(person.posterior, along=person.posterior.covariance)
    vertices = person.surface.vertices[::50]
    own = person.surface_sd_mm(vertices)
    assert (own < dataclasses.replace(person, posterior=as_elsewhere).surface_sd_mm(vertices)).all()
    assert (own > person.posterior.noise * atlas.frame.scale_mm).all()


def test_bad_patients_get_a_sentence(atlas):
    for given, message in [
        (np.zeros((5, 3)), "has 5 points"),
        (np.zeros((50, 2)), "give \\[n, 3\\]"),
        (np.full((50, 3), np.nan), "not finite"),
    ]:
        with pytest.raises(InputError, match=message):
            atlas.fit(given)
    with pytest.raises(InputError, match="99 years"):
        atlas.fit(egg(5, 1), {"age": 99})
    with pytest.raises(InputError, match="unknown covariate 'height'"):
        atlas.fit(egg(5, 1), {"height": 1})


def test_cancelling_and_progress(atlas, made):
    with pytest.raises(Cancelled):
        atlas.fit(made[2], progress=Progress(is_unwanted=lambda: True))
    told: list[float] = []
    atlas.fit(made[2], progress=Progress(told.append))
    assert told == sorted(told) and told[-1] == pytest.approx(1)


def test_the_person_at_other_covariates(atlas, made):
    values, _, shape = made
    fit = atlas.fit(shape, values)
    older = fit.at({"age": 8.5})
    assert older.covariates == pytest.approx({"age": 8.5, "sex": 1.0})
    assert older.volume_cm3 > fit.volume_cm3
    low, high = older.volume_interval_cm3
    assert low < older.volume_cm3 < high
    surface = older.shape(32)
    deviations = older.surface_sd_mm(surface.vertices)
    assert deviations.shape == (len(surface.vertices),) and (deviations > 0).all()
    with pytest.raises(InputError, match="99 years"):
        fit.at({"age": 99})


def test_the_margin_of_a_surface_is_that_of_every_point(atlas, made):
    person = atlas.fit(made[2], made[0]).individual
    points_mm = person.shape(96).vertices
    assert len(points_mm) > 2 * 1500
    everywhere = 1.959964 * person.surface_sd_mm(points_mm)
    margin_mm = person.surface_margin_mm(points_mm)
    assert np.abs(margin_mm / everywhere - 1).max() < 0.1
    few = points_mm[:3]
    assert person.surface_margin_mm(few) == pytest.approx(1.959964 * person.surface_sd_mm(few), rel=1e-3)


def test_a_model_that_carries_no_shape_elsewhere_shows_the_fit_itself(atlas, made, monkeypatch):
    values, _, shape = made
    fit = atlas.fit(shape, values)
    own = dataclasses.replace(atlas.capabilities, transferable=False)
    monkeypatch.setattr(model_class(atlas.checkpoint.preset.model), "capabilities", own)
    rounded = {name: value + 1e-9 for name, value in fit.covariates.items()}
    for asked in ({}, values, fit.covariates, rounded):
        assert np.array_equal(fit.at(asked).latent, fit.latent)
    for asked in ({"age": 6.6}, {"age": 6.5, "sex": -1.0}):
        with pytest.raises(InputError, match="does not carry shapes to other covariates; ask for the fitted"):
            fit.at(asked)


def test_on_another_day_a_person_is_nearer_the_average_and_less_sure(atlas, made):
    values, _, shape = made
    person = atlas.fit(shape, values).individual
    prior = dataclasses.replace(person.posterior.problem.prior, lasting=0.3)
    problem = dataclasses.replace(person.posterior.problem, prior=prior)
    person = dataclasses.replace(person, posterior=dataclasses.replace(person.posterior, problem=problem))
    here, near, far = (person.elsewhere(person.vector + np.array([step, 0.0])) for step in (0.0, 0.05, 3.0))
    assert np.array_equal(here.latent, person.latent) and here.posterior is person.posterior
    assert far.latent == pytest.approx(0.3 * person.latent)
    shares = [np.linalg.norm(one.latent) / np.linalg.norm(person.latent) for one in (here, near, far)]
    assert shares[0] > shares[1] > shares[2]
    expected = 0.09 * person.posterior.covariance + 0.91 * np.eye(len(person.latent))
    assert far.posterior.along == pytest.approx(expected)
    spreads = [np.trace(one.posterior.along) for one in (here, near, far)]
    assert spreads[0] < spreads[1] < spreads[2]


def test_the_growth_path_follows_the_population(atlas):
    path = growth_path(atlas.population, "age", np.array([2.0, 5.0, 8.0]))
    assert path[:, 0] == pytest.approx([2, 5, 8])
    assert np.abs(path[:, 1]).max() < 0.5  # girls and boys alternate along age
