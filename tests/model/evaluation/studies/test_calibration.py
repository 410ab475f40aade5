"""Counting how often intervals hold the truth."""

from __future__ import annotations

from naisr_model.evaluation.studies.calibration import calibration_markdown


def test_a_calibration_is_told_in_a_table():
    volume = {"coverage": 0.95, "width": 2.0, "error": 0.5, "unit": "cm³"}
    rows = {"volume": volume, "age": volume | {"coverage": 1.0}}
    rows["sex"] = {"coverage": 1.0, "undecided": 0.6, "wrong": 0.4}
    text = calibration_markdown({"n": 7, "known": [], "rows": rows})
    assert "7 new patients" in text and "| volume | 95.0% | 2 cm³ | 0.5 cm³ | yes |" in text
    assert "| age | 100.0% | 2 cm³ | 0.5 cm³ | no |" in text
    assert "| sex | 100.0% | 60% undecided | 40% wrong | yes |" in text
