"""Numbers as people read them."""

from __future__ import annotations

from naisr_model.covariates import Covariate
from naisr_model.frames import Frame
from naisr_viewer.words.numbers import (
    duration,
    gained,
    in_unit,
    interval_reading,
    length,
    reading,
    volume,
    way,
)


def test_figures_have_digits_that_mean_something():
    assert volume(48.31, 2.13) == "48.3 ± 2.1 cm³"
    assert volume(48.31, 0.0213) == "48.310 ± 0.021 cm³"
    assert volume(62410.3, 1234.0) == "62,400 ± 1,200 cm³"
    assert volume(48.31, 0.0) == volume(48.31) == "48.3 cm³"
    assert volume(62410.3) == "62,410 cm³"
    assert gained(61.0, 48.3) == "+12.7 cm³ (+26\u00a0%)"
    assert gained(48.3, 61.0) == "−12.7 cm³ (−21\u00a0%)"
    assert gained(33.91, 33.2) == "+0.71 cm³ (+2.1\u00a0%)"
    assert gained(33.46, 33.3, 0.51) == "+0.16 cm³ (+0.5\u00a0%)"


def test_areas_and_lengths_of_no_known_unit_have_digits_that_count():
    area = Frame((0.0, 0.0), 2.0, "units").extent
    assert volume(1.44698, None, area) == "1.447 units²"
    assert volume(1.44698, 0.0123, area) == "1.447 ± 0.012 units²"
    assert gained(1.5, 1.4, None, area) == "+0.100 units² (+7.1\u00a0%)"
    assert length(0.01234, "units") == "0.0123 units"
    assert way(-0.5, "px") == "−0.500 px" and way(0.0, "px") == "0 px"
    assert in_unit("in mm, not in mmHg", "px") == "in px, not in mmHg"


def test_digits_suit_the_range():
    def of(low: float, high: float) -> int:
        return Covariate("x", "", "continuous", 0, 1, (low, high)).decimals

    assert (of(1, 233), of(3.9, 94), of(0, 1), of(0, 5000)) == (0, 1, 2, 0)


def test_an_interval_is_told_in_the_covariates_own_digits(card):
    age, weight, sex = card.covariates
    assert interval_reading(age, 71.2, 96.8) == "95\u00a0%: 71 to 97 months"
    assert interval_reading(weight, 18.23, 24.91) == "95\u00a0%: 18.2 to 24.9 kg"
    assert interval_reading(sex, -1, 1) == "inferred; F or M"
    assert interval_reading(sex, 1, 1) == "inferred"


def test_no_number_is_written_as_a_power_of_ten():
    assert [length(mm) for mm in (0.0412, 9.999, 13.51, 2314.2)] == [
        "0.04 mm",
        "10.0 mm",
        "13.5 mm",
        "2,314 mm",
    ]
    assert [duration(s) for s in (0.487, 4.21, 132.4)] == ["0.49 s", "4.2 s", "132 s"]


def test_a_range_is_told_by_ends_that_can_be_given():
    odd = Covariate("weight", "kg", "continuous", 30, 20, (2.5837, 91.4689))
    assert odd.extent == "2.6 to 91.5 kg"
    low, high = odd.extent.removesuffix(" kg").split(" to ")
    assert odd.contains(float(low)) and odd.contains(float(high))
    assert Covariate("age", "months", "continuous", 30, 20, (1.0, 233.0)).extent == "1 to 233 months"
    assert Covariate("x", "", "continuous", 5.25, 1, (5.25, 5.25)).extent == "5.25 to 5.25"
    assert Covariate("share", "%", "continuous", 0.3, 1, (0.1, 0.7)).extent == "0.1 to 0.7 %"


def test_between_two_levels_no_bare_number_is_told(card):
    sex = card.covariates[2]
    assert reading(sex, 0.0) == "halfway between F and M"
    assert reading(sex, 0.351) == "between F and M, 35 % towards M"
    assert reading(sex, -1.0) == "F"
