"""By what the matrix is laid out, and which covariates its cells have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from naisr_viewer.state.matrix import (
    Matrix,
    Side,
    cells_of,
    first_matrix,
    kept_matrix,
    nearest,
    side_of,
    values_at,
    with_count,
    with_covariate,
)


@pytest.fixture
def matrix(card) -> Matrix:
    matrix = first_matrix(card)
    assert matrix is not None
    return matrix


def test_continuous_covariates_come_first_and_one_alone_makes_no_matrix(card):
    first, *others = card.covariates
    last = replace(card, covariates=(*others[::-1], first))  # sex, weight, age
    matrix = first_matrix(last)
    assert matrix is not None
    assert (matrix.across.covariate, matrix.down.covariate) == ("weight", "age")
    assert first_matrix(replace(card, covariates=(first,))) is None


def test_values_are_at_equal_distances_where_nine_people_of_ten_are(card):
    values = side_of(card, "age", 4).values
    below, above = np.quantile(card.population.values[:, 0], (0.05, 0.95))
    assert np.ptp(np.diff(values)) <= 1  # months, to which they are rounded
    assert (values[0], values[-1]) == pytest.approx((below, above), abs=0.5)
    assert side_of(card, "sex", 4).values == (-1.0, 1.0)


def test_values_stay_inside_the_observed_range_and_apart(card):
    alike = replace(card, population=replace(card.population, values=card.population.values * 0 + 100.4))
    values = side_of(alike, "age", 6).values
    low, high = card.covariates[0].range
    assert len(set(values)) == 6 and low <= min(values) and max(values) <= high


def test_a_covariate_stands_at_one_side_only(card, matrix):
    exchanged = with_covariate(card, matrix, "across", "weight")
    assert (exchanged.across, exchanged.down) == (matrix.down, matrix.across)
    assert with_covariate(card, matrix, "across", "age") == matrix
    by_sex = with_covariate(card, matrix, "down", "sex")
    assert by_sex.across == matrix.across and by_sex.down == Side("sex", (-1.0, 1.0))
    assert with_covariate(card, by_sex, "down", "weight") == matrix  # as many rows as at first
    assert len(with_count(card, matrix, "down", 5).down.values) == 5


def test_cells_have_their_own_covariates_and_the_rest_as_it_is_off_the_axes(card, matrix):
    present = (20.0, 70.0, 1.0)
    age, weight = matrix.across.values[1], matrix.down.values[2]
    assert len(cells_of(matrix)) == (4 + 1) * (3 + 1)
    assert values_at(card, matrix, (2, 3), present) == (age, weight, 1.0)
    assert values_at(card, matrix, (2, 0), present) == (age, 35.0, 0.0)
    assert values_at(card, matrix, (0, 3), present) == (100.0, weight, 0.0)
    assert values_at(card, matrix, (0, 0), present) == card.start


def test_the_nearest_cell_is_the_one_whose_covariates_were_taken(card, matrix):
    for cell in cells_of(matrix):
        assert nearest(card, matrix, values_at(card, matrix, cell, (20.0, 70.0, 1.0))) == cell
    assert nearest(card, matrix, card.start) == (0, 0)
    assert nearest(card, matrix, (220.0, 95.0, 1.0)) == (4, 3)


@pytest.mark.parametrize(
    "across",
    [Side("height", (1.0, 2.0)), Side("age", ()), Side("age", (5.0, 900.0)), Side("weight", (5.0, 30.0))],
    ids=["unknown", "empty", "outside", "twice"],
)
def test_what_an_atlas_does_not_have_is_not_kept(card, matrix, across):
    assert kept_matrix(card, replace(matrix, across=across)) == matrix
    assert kept_matrix(card, None) == matrix
    other = replace(matrix, across=Side("age", (5.0, 30.0)))
    assert kept_matrix(card, other) == other
