"""Which covariates the data are shown over, and what is shown of people and patients."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from naisr_viewer.state.explorer import ExplorerState, opened
from naisr_viewer.state.patients import Fitted, OpenScan, Reading, Scan
from naisr_viewer.state.support import Support, marks_of, remoteness, suited, visits_of, with_axis

AGE_WEIGHT = Support("age", "weight")
CORNERS = np.zeros((3, 3), np.float32)


def patient(key: int, known=(), fit: Fitted | None = None) -> OpenScan:
    scan = Scan(CORNERS, CORNERS, np.zeros((0, 3), np.int64), "p.stl")
    return OpenScan(key, f"p{key}.stl", Reading(Path("p.stl")), scan, known, fit)


def fitted(intervals=(), covariances=(), is_valid=True) -> Fitted:
    values = (("age", 84.0), ("weight", 21.0), ("sex", -1.0))
    return Fitted(1, values, intervals, 48.0, 3.0, 0.4, 0.4, 2.0, (), is_valid, covariances)


def test_an_atlas_opens_over_its_first_continuous_covariates(card):
    age, weight, sex = card.covariates
    assert opened(ExplorerState(), card).support == AGE_WEIGHT
    for covariates, x, y in [
        ((sex, weight, age), "weight", "age"),
        ((sex, weight), "weight", "sex"),
        ((age,), "", ""),
        ((), "", ""),
    ]:
        assert suited(Support(is_open=False), replace(card, covariates=covariates)) == Support(x, y, False)


def test_the_axes_that_were_chosen_stay_where_an_atlas_has_them(card):
    assert suited(Support("sex", "age"), card) == Support("sex", "age")
    for foreign in (Support("height", "age"), Support("age", "age")):
        assert suited(foreign, card) == AGE_WEIGHT


def test_two_axes_never_show_one_covariate():
    assert with_axis(AGE_WEIGHT, "x", "sex") == Support("sex", "weight")
    assert with_axis(AGE_WEIGHT, "x", "weight") == Support("weight", "age")
    assert with_axis(AGE_WEIGHT, "y", "age") == Support("weight", "age")
    assert with_axis(AGE_WEIGHT, "y", "weight") == AGE_WEIGHT


def test_visits_of_one_subject_are_behind_each_other_and_nobody_held_out_is_there(card):
    people = replace(
        card.population,
        subjects=tuple(f"s{i % 60}" for i in range(200)),
        visits=tuple(map(str, range(200))),
        held_out=np.arange(200) % 60 == 0,
    )
    visits = visits_of(AGE_WEIGHT, replace(card, population=people))
    assert len(visits.places) == 196 and np.count_nonzero(np.diff(visits.subjects)) == 58
    own = people.values[[1, 61, 121, 181]][:, :2]
    assert visits.places[visits.subjects == visits.subjects[0]].tolist() == own.tolist()


def test_how_far_people_are_is_asked_at_the_other_covariates(card):
    """Also over axes the other way round."""
    here = {"age": 50.0, "weight": 90.0, "sex": 0.0}
    field = remoteness(Support("sex", "age"), card, here)
    for column, row in ((3, 5), (40, 60)):
        asked = {"sex": field.x[column], "age": field.y[row], "weight": 90.0}
        assert (field.values[row, column] <= 1) == card.population.has_data_at(asked)
    assert (field.values > 1).all()  # nobody weighs so much
    assert (remoteness(Support("sex", "age"), card, {**here, "weight": 35.0}).values <= 1).any()


def test_the_ellipse_holds_95_percent_of_what_is_believed():
    covariance = np.array([[100.0, 24.0], [24.0, 9.0]])
    named = [(("age", "weight")[i], ("age", "weight")[j], covariance[i, j]) for i in (0, 1) for j in (0, 1)]
    both = fitted((("age", 64.0, 104.0), ("weight", 15.0, 27.0)), tuple(named))
    (mark,) = marks_of(Support("weight", "age"), (patient(1, fit=both),))
    assert mark.place == (21.0, 84.0)
    (outline,) = mark.outlines
    offsets = outline[:, ::-1] - [84.0, 21.0]
    squared = np.einsum("ki,ij,kj->k", offsets, np.linalg.inv(covariance), offsets)
    draws = np.random.default_rng(0).multivariate_normal([0, 0], covariance, 100_000)
    inside = np.einsum("ki,ij,kj->k", draws, np.linalg.inv(covariance), draws) <= squared.min()
    assert squared == pytest.approx(squared[0]) and inside.mean() == pytest.approx(0.95, abs=0.003)


def test_patients_are_shown_as_far_as_is_known():
    one = fitted((("weight", 18.0, 25.0),), (("weight", "weight", 3.0),))
    patients = (
        patient(1, known=(("age", 80.0), ("weight", 30.0))),
        patient(2, known=(("age", 80.0),)),
        patient(3, fit=one),
        patient(4, known=(("age", 80.0), ("weight", 30.0)), fit=fitted(is_valid=False)),
    )
    marks = {mark.key: mark for mark in marks_of(AGE_WEIGHT, patients)}
    assert set(marks) == {1, 3, 4}
    assert marks[1].place == marks[4].place == (80.0, 30.0) and marks[1].outlines == ()
    (line,) = marks[3].outlines
    assert line.tolist() == [[84.0, 18.0], [84.0, 25.0]]
