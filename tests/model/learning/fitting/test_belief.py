"""What is known of covariates once the shape has been asked."""

import numpy as np
import pytest

from naisr_model.learning.fitting.belief import Told, believed, places_of
from naisr_model.learning.fitting.prior import conditional


def told(mean: float, precision: float, place: float | None = None, log_height: float = 0.0) -> Told:
    at = mean if place is None else place
    return Told(np.array([at]), np.array([mean]), np.array([[precision]]), log_height)


def test_the_population_itself_takes_the_place_of_its_gaussian(prior):
    fixed = np.array([np.nan, 1.0])
    # A shape that tells the age to a hundredth leaves nothing to the prior ...
    sure = believed(prior, fixed, [told(0.4, 1e4)])
    assert sure.mean[0] == pytest.approx(0.4, abs=0.01)
    assert sure.covariance[0, 0] == pytest.approx(1e-4, rel=0.1)
    # ... and one that tells nothing leaves all of it: the ages of those of this sex.
    mean, precision = conditional(prior, fixed)
    unsure = believed(prior, fixed, [Told(mean, mean, precision, 0.0)])
    ages = prior.training[prior.training[:, 1] == 1, 0]
    assert unsure.mean[0] == pytest.approx(ages.mean(), abs=0.2)
    assert np.sqrt(unsure.covariance[0, 0]) > ages.std()
    # Ages are even from the youngest to the oldest, and so is what is believed of them.
    ends = np.interp([0.025, 0.975], np.cumsum(unsure.densities[0]), places_of(prior, 0))
    assert ends == pytest.approx(np.quantile(prior.training[:, 0], [0.025, 0.975]), abs=0.15)
    assert unsure.densities.sum() == pytest.approx(1)


def test_nobody_is_believed_to_be_beyond_the_observed_ages(prior):
    belief = believed(prior, np.array([np.nan, 1.0]), [told(prior.highest[0] + 0.5, 4.0)])
    assert belief.mean[0] < prior.highest[0] and belief.densities[0].argmax() > 400


def test_what_is_told_elsewhere_counts_there(prior):
    fixed, here = np.array([np.nan, 1.0]), told(-1.0, 25.0)
    alone = believed(prior, fixed, [here])
    both = believed(prior, fixed, [here, told(1.0, 2.0, log_height=-1.0)])
    assert alone.densities[0][-200:].sum() < 1e-3 < 0.05 < both.densities[0][-200:].sum()
    assert both.log_gain > alone.log_gain
