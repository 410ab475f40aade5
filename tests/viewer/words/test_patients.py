"""Patients in words."""

from __future__ import annotations

from naisr_viewer.words.patients import breakable, sentence


def test_a_long_name_can_be_broken_and_a_sentence_begins_with_a_capital():
    name = "a_segmentation_that_somebody_named_at_length.nii.gz"
    assert breakable(f"{name}, label 2").replace("\u200b", "") == f"{name}, label 2"
    assert "\u200b" in breakable(name)
    assert sentence("the surface is open") == "The surface is open"
    assert sentence("p01.stl: all is well") == "p01.stl: all is well"
