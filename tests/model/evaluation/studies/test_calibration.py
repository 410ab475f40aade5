"""Counting how often intervals hold the truth."""

from __future__ import annotations

import pytest

from naisr_model.errors import InputError
from naisr_model.evaluation.studies.calibration import Calibration
from naisr_model.evaluation.study import run


def test_intervals_are_counted_over_new_people_inside_the_ranges(egg_people):
    report = run(Calibration(egg_people.atlas, patients=3, known="sex"))
    assert report["n"] == 3 and report["known"] == ["sex"]
    assert report["rows"].keys() == {"age", "volume"}
    assert report["rows"]["age"]["unit"] == "years" and 0 < report["rows"]["age"]["error"] < 1
    assert 0 < report["rows"]["volume"]["width"] < 30


def test_a_record_is_truth_estimate_and_interval(egg_people):
    study = Calibration(egg_people.atlas, patients=2)
    records = [
        {"age": [5.0, 5.5, 4.0, 6.0], "sex": [1.0, 1.0, -1.0, 1.0], "volume": [50.0, 51.0, 48.0, 52.0]},
        {"age": [5.0, 7.0, 6.0, 8.0], "sex": [1.0, -1.0, -1.0, -1.0], "volume": [50.0, 49.0, 48.0, 50.0]},
    ]
    rows = study.summarise(records)["rows"]
    assert rows["age"] == {"coverage": 0.5, "width": 2.0, "error": pytest.approx(2.125**0.5), "unit": "years"}
    assert rows["sex"] == {"coverage": 0.5, "undecided": 0.5, "wrong": 0.5}
    assert rows["volume"]["coverage"] == 1.0


def test_it_is_told_in_a_table(egg_atlas):
    volume = {"coverage": 0.95, "width": 2.0, "error": 0.5, "unit": "cm³"}
    rows = {"volume": volume, "age": volume | {"coverage": 1.0}}
    rows["sex"] = {"coverage": 1.0, "undecided": 0.6, "wrong": 0.4}
    text = Calibration(egg_atlas).markdown({"n": 7, "known": [], "rows": rows})
    assert "7 new patients" in text and "| volume | 95.0 % | 2 cm³ | 0.5 cm³ | yes |" in text
    assert "| age | 100.0 % | 2 cm³ | 0.5 cm³ | no |" in text
    assert "| sex | 100.0 % | 60 % undecided | 40 % wrong | yes |" in text


def test_what_makes_no_sense_is_refused(egg_people, egg_atlas):
    for study, message in (
        (Calibration(egg_people.atlas, patients=0), "--patients is 0; give 1 or more"),
        (Calibration(egg_people.atlas, known="age,height"), "unknown covariate 'height'; this atlas has age"),
        (Calibration(egg_atlas), "real truth is not known"),
    ):
        with pytest.raises(InputError, match=message):
            run(study)
