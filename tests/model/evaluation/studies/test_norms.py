"""Norms are held against people whom nobody has seen."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm as normal

from naisr_model.errors import InputError
from naisr_model.evaluation.studies.norms import SCAN, NormsStudy
from naisr_model.evaluation.study import run


def test_people_larger_than_all_of_the_population_stand_above_them(egg_people, monkeypatch):
    monkeypatch.setattr("naisr_model.measures.curves.COARSE", 32)
    report = run(NormsStudy(egg_people.atlas, patients=2))
    assert report["n"] == 2 and report["rows"].keys() == {"volume", "area", SCAN}
    # 1.02 ** 3 of the volume, where eggs of one age and sex are all alike.
    assert report["rows"][SCAN]["mean"] > 1
    assert 0 <= report["inside"] <= 1


def test_z_of_a_standard_normal_number_is_calibrated(egg_atlas):
    z = normal.ppf((np.arange(400) + 0.5) / 400)
    report = NormsStudy(egg_atlas).summarise([{"z": {"volume": one}, "inside": 0.9} for one in z])
    row = report["rows"]["volume"]
    assert row["coverage"] == pytest.approx(0.95) and row["ks"] < 0.01 and row["p"] > 0.99
    assert row["sd"] == pytest.approx(1, abs=0.01)
    text = NormsStudy(egg_atlas).markdown(report)
    assert "| volume | 95.0 % |" in text and "90.0 % lies inside" in text


def test_norms_that_are_too_narrow_are_found(egg_atlas):
    z = 2 * normal.ppf((np.arange(400) + 0.5) / 400)
    row = NormsStudy(egg_atlas).summarise([{"z": {"area": one}, "inside": 1.0} for one in z])["rows"]["area"]
    assert row["coverage"] == pytest.approx(2 * normal.cdf(0.98) - 1, abs=0.01) and row["p"] < 1e-3


def test_what_makes_no_sense_is_refused(egg_people, egg_atlas):
    for study, message in (
        (NormsStudy(egg_people.atlas, patients=0), "--patients is 0; give 1 or more"),
        (NormsStudy(egg_atlas), "real truth is not known"),
    ):
        with pytest.raises(InputError, match=message):
            run(study)
