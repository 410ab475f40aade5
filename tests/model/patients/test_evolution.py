"""A fitted egg along age: with the population, by age alone, and by a table."""

from __future__ import annotations

import numpy as np
import pytest
from eggs import egg

from naisr_model.atlas import Atlas, Fit
from naisr_model.errors import InputError
from naisr_model.patients.evolution import along_only, evolution, fit_record, parsed


@pytest.fixture(scope="module")
def fit(egg_atlas) -> Fit:
    return Atlas.load(egg_atlas).fit(egg(6.5, 1.0), {"age": 6.5, "sex": 1.0})


def test_the_others_go_with_the_population(fit):
    people = evolution(fit, "age", None, 9.0, 3, "population")
    assert [one.covariates["age"] for one in people] == pytest.approx([6.5, 7.75, 9.0])
    assert all(one.covariates["sex"] == 1 for one in people)


def test_one_covariate_alone_is_its_effect(fit):
    only = along_only(fit, "age", np.array([8.0]))[0]
    effect = fit.individual.atlas.effect("age", 8.0, only.latent, 32)
    assert only.shape(32).volume == pytest.approx(effect.volume, rel=1e-4)


def test_a_table_says_each_step(fit, tmp_path):
    table = tmp_path / "path.csv"
    table.write_text("age\n3\n4\n")
    assert [one.covariates["age"] for one in evolution(fit, "age", None, None, 1, str(table))] == [3, 4]
    table.write_text("height\n3\n")
    with pytest.raises(InputError, match="unknown covariate 'height'"):
        evolution(fit, "age", None, None, 1, str(table))
    table.write_text("age\n")
    with pytest.raises(InputError, match="has no rows"):
        evolution(fit, "age", None, None, 1, str(table))
    with pytest.raises(InputError, match="--steps is 0"):
        evolution(fit, "age", None, None, 0, "population")


def test_values_are_read_in_the_units_of_their_covariates(fit):
    assert parsed(fit.individual.atlas, {"age": "3.5", "sex": "F"}) == {"age": 3.5, "sex": -1.0}


def test_a_fit_is_told_in_plain_numbers(fit):
    record = fit_record(fit)
    assert record["covariates"] == pytest.approx({"age": 6.5, "sex": 1.0}) and record["inferred"] == []
    low, high = record["volume_interval_cm3"]
    assert low < record["volume_cm3"] < high and len(record["latent"]) == 4
