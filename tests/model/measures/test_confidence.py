"""How sure the mean of people is, held to refits without each of them and to people whose mean is known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from naisr_model.covariates import Covariate, Population
from naisr_model.errors import InputError
from naisr_model.measures.confidence import confidence_of, design_of, restricted_spline

AGE = Covariate("age", "years", "continuous", 5.0, 2.0, (0.0, 10.0))
SEX = Covariate("sex", "", "binary", 0.0, 1.0, (-1.0, 1.0), ("F", "M"))


def people(subjects: int, visits: int = 2, seed: int = 0) -> Population:
    """Each seen some times in two years."""
    rng = np.random.default_rng(seed)
    age = np.clip(rng.uniform(0, 8, subjects)[:, None] + rng.uniform(0, 2, (subjects, visits)), 0, 10)
    sex = np.broadcast_to(np.resize([-1.0, 1.0], subjects)[:, None], age.shape)
    return Population(
        covariates=(AGE, SEX),
        subjects=tuple(f"s{i}" for i in np.repeat(np.arange(subjects), visits)),
        visits=tuple(str(i) for i in np.tile(np.arange(visits), subjects)),
        values=np.stack([age.ravel(), sex.ravel()], axis=1),
        held_out=np.zeros(subjects * visits, dtype=bool),
    )


def test_a_restricted_spline_is_the_natural_one_through_its_knots():
    knots, wanted = np.array([-1.0, -0.2, 0.5, 1.5]), np.array([0.3, -1.0, 2.0, 0.4])
    columns = np.column_stack([np.ones(4), restricted_spline(knots, knots)])
    coefficients = np.linalg.solve(columns, wanted)
    places = np.linspace(-1.0, 1.5, 50)
    found = np.column_stack([np.ones(50), restricted_spline(places, knots)]) @ coefficients
    assert found == pytest.approx(CubicSpline(knots, wanted, bc_type="natural")(places), abs=1e-12)
    for beyond in (np.linspace(-4, -1, 9), np.linspace(1.5, 4, 9)):
        assert np.diff(restricted_spline(beyond, knots), 2, axis=0) == pytest.approx(0, abs=1e-12)


def test_it_is_how_far_the_mean_moves_without_each_subject_and_how_far_it_missed():
    population = people(40)
    differences = np.random.default_rng(1).normal(size=(80, 3))
    design = design_of(population)
    columns, row = design.rows(population.normalised()), design.row({"age": 8.0, "sex": 1.0})
    whole = np.linalg.lstsq(columns, differences)[0]
    without = []
    for subject in range(40):
        kept = np.array(population.subjects) != f"s{subject}"
        without.append(row @ np.linalg.lstsq(columns[kept], differences[kept])[0])
    variance = 39 / 40 * np.sum((np.array(without) - row @ whole) ** 2, axis=0)
    found = confidence_of(design, differences)
    assert found.freedom == 40 - len(row)
    t = 2.0281  # tables: 97.5 % at 36 degrees of freedom
    assert found.margin(row) == pytest.approx(t * np.sqrt(variance + (row @ whole) ** 2), rel=1e-4)


def test_an_effect_at_the_centre_is_none():
    design = design_of(people(40))
    found = confidence_of(design, np.random.default_rng(1).normal(size=(80, 2)))
    assert found.margin(design.row({"age": 5.0}) - design.row({})) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("subjects", [20, 60])
def test_the_truth_lies_within_the_band_as_often_as_it_says(subjects):
    population, rng = people(subjects), np.random.default_rng(2)
    design = design_of(population)
    lasting = np.repeat(rng.normal(size=(subjects, 1000)), 2, axis=0)  # what two visits have in common
    differences = lasting + 0.5 * rng.normal(size=(2 * subjects, 1000))
    regressed = confidence_of(design, differences).missed
    # An atlas that follows its people as the regression does misses their mean by nothing. The truth is 0.
    followed = confidence_of(design, differences - design.rows(population.normalised()) @ regressed.T)
    for values in ({"age": 2.0}, {"age": 9.0}, {"sex": 1.0}):
        row = design.row(values)
        inside = np.mean(np.abs(regressed @ row) <= followed.margin(row))
        assert 0.93 <= inside <= 0.98


def test_values_of_which_there_are_few_are_taken_for_straight():
    population = people(40)
    population.values[:, 0] = np.where(population.values[:, 0] > 5, 9.0, 1.0)
    assert len(design_of(population).row({})) == 3


def test_too_few_people_say_nothing():
    with pytest.raises(
        InputError, match="4 subjects are too few to say how sure the effects of 2 covariates"
    ):
        design_of(people(4))
    one_boy = people(40)
    one_boy.values[:, 1] = np.where(np.array(one_boy.subjects) == "s0", 1.0, -1.0)
    with pytest.raises(InputError, match="40 subjects are too few"):
        design_of(one_boy)
    girls = people(40)
    girls.values[:, 1] = -1.0
    with pytest.raises(InputError, match="40 subjects are too few"):
        design_of(girls)
