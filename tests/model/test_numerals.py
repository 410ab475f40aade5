"""Numbers as people write them: what is read, and what is said of what cannot be."""

from __future__ import annotations

import re

import pytest

from naisr_model.covariates import Covariate
from naisr_model.errors import InputError
from naisr_model.numerals import decimal_marks, is_missing, read_number


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("12,5", 12.5),
        ("12.5", 12.5),
        (" 7 ", 7),
        (".5", 0.5),
        ("5.", 5),
        ("0,234", 0.234),
        ("1.234", 1.234),
        ("1,2345", 1.2345),
        ("1,234,567", 1234567),
        ("1.234.567", 1234567),
        ("1.234,5", 1234.5),
        ("1,234.5", 1234.5),
        ("1 234,5", 1234.5),
        ("1\u00a0234", 1234),
        ("1'234.5", 1234.5),
        ("-3", -3),
        ("\u22123,5", -3.5),
        ("1e-3", 0.001),
        ("2,5E+1", 25),
    ],
)
def test_numbers_are_read_however_they_are_written(text, number):
    assert read_number(text) == number


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1,234", "may be 1.234 or 1234"),
        ("1_000", "without _"),
        ("12 months", "write [months] into the header"),
        ("12kg", "write [kg] into the header"),
        ("35 %", "write [%] into the header"),
        ("2014-05-03", "a date"),
        ("3.5.2014", "a date"),
        ("<5", "a range"),
        ("12-14", "a range"),
        ("n/a", "missing"),
        ("NaN", "missing"),
        ("", "missing"),
        ("inf", "expected a number"),
        ("0x1F", "expected a number"),
        ("\u0661\u0662", "expected a number"),
        ("1,2,3", "expected a number"),
        ("12,34,567", "expected a number"),
        ("old", "expected a number"),
        ("1e308", "larger than anything"),
    ],
)
def test_what_is_no_number_is_told_with_what_to_do(text, words):
    with pytest.raises(ValueError, match=re.escape(words)):
        read_number(text)


def test_other_numbers_tell_what_a_comma_or_a_point_means():
    assert decimal_marks(["1,234", "12"]) == frozenset()
    assert decimal_marks(["1,234", "12,5"]) == {","}
    assert decimal_marks(["1.234,5", "p01.stl"]) == {","}
    assert read_number("1,234", {","}) == 1.234
    for marks in ({","}, {",", "."}):
        with pytest.raises(ValueError, match=r"1\.234 or 1234"):
            read_number("1.234", marks)


def test_words_for_a_missing_value_are_known():
    assert all(map(is_missing, ["", " ", "NA", "n/a", "NaN", "None", "-", "#N/A", "null", "."]))
    assert not any(map(is_missing, ["0", "F", "-1", "Nan Goldin"]))


def test_a_covariate_takes_the_same_numbers_and_levels_of_any_case():
    age = Covariate("age", "months", "continuous", 0, 1, (0, 100))
    sex = Covariate("sex", "", "binary", 0, 1, (-1, 1), ("F", "M"))
    assert age.parse("12,5") == 12.5
    assert sex.parse("m") == 1.0
    for text in ("1,234", "1_000", "12 months", "inf"):
        with pytest.raises(InputError, match="'age'"):
            age.parse(text)
