"""Numbers as people read them."""

from __future__ import annotations

from naisr_model.covariates import Covariate
from naisr_viewer.words.numbers import decimals, gained, volume


def test_figures_have_digits_that_mean_something():
    assert volume(48.31, 2.13) == "48.3 ± 2.1 cm³"
    assert volume(48.31, 0.0213) == "48.310 ± 0.021 cm³"
    assert volume(62410.3, 1234.0) == "62,400 ± 1,200 cm³"
    assert volume(48.31, 0.0) == volume(48.31) == "48.3 cm³"
    assert volume(62410.3) == "62,410 cm³"
    assert gained(61.0, 48.3) == "+12.7 cm³ (+26 %)"
    assert gained(48.3, 61.0) == "−12.7 cm³ (−21 %)"


def test_digits_suit_the_range():
    def of(low: float, high: float) -> int:
        return decimals(Covariate("x", "", "continuous", 0, 1, (low, high)))

    assert (of(1, 233), of(3.9, 94), of(0, 1), of(0, 5000)) == (0, 1, 2, 0)
