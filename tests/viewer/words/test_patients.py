"""Patients in words."""

from __future__ import annotations

from naisr_viewer.words.patients import breakable, interval, sentence


def test_an_interval_is_told_in_the_covariates_own_digits(card):
    age, weight, sex = card.covariates
    assert interval(age, 71.2, 96.8) == "95 %: 71 to 97 months"
    assert interval(weight, 18.23, 24.91) == "95 %: 18.2 to 24.9 kg"
    assert interval(sex, -1, 1) == "inferred; F or M"
    assert interval(sex, 1, 1) == "inferred"


def test_a_long_name_can_be_broken_and_a_sentence_begins_with_a_capital():
    name = "a_segmentation_that_somebody_named_at_length.nii.gz"
    assert breakable(f"{name}, label 2").replace("\u200b", "") == f"{name}, label 2"
    assert "\u200b" in breakable(name)
    assert sentence("the surface is open") == "The surface is open"
    assert sentence("p01.stl: all is well") == "p01.stl: all is well"
