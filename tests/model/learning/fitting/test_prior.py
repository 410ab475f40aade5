"""What is expected of a shape before it is seen."""

import dataclasses

import numpy as np
import pytest

from naisr_model.learning.fitting.prior import conditional, prior_of


def test_covariates_are_believed_as_the_known_ones_suggest(prior):
    mean, precision = conditional(prior, np.array([np.nan, np.nan]))
    assert mean == pytest.approx(prior.mean) and np.linalg.inv(precision) == pytest.approx(prior.covariance)
    mean, precision = conditional(prior, np.array([np.nan, 1.0]))
    slope = prior.covariance[0, 1] / prior.covariance[1, 1]
    assert mean[0] == pytest.approx(prior.mean[0] + slope * (1 - prior.mean[1]))
    assert 1 / precision[0, 0] == pytest.approx(prior.covariance[0, 0] - slope * prior.covariance[0, 1])


def test_what_lasts_of_codes_is_their_correlation_between_visits(atlas):
    count = int((~atlas.population.held_out).sum())
    subjects = np.array([f"S{row}" for row in range(len(atlas.population.subjects))])
    rows = np.flatnonzero(~atlas.population.held_out)[: 2 * (count // 2)]
    subjects[rows[1::2]] = subjects[rows[::2]]
    paired = dataclasses.replace(atlas.population, subjects=tuple(subjects))
    rng = np.random.default_rng(0)
    own = np.repeat(rng.normal(size=(count // 2 + 1, 400)), 2, axis=0)[:count]  # 400 directions to average
    for lasting in (0.0, 0.3, 0.8, 1.0):
        visit = rng.normal(size=own.shape)
        codes = np.sqrt(lasting) * own + np.sqrt(1 - lasting) * visit
        assert prior_of(paired, codes.astype(np.float32)).lasting == pytest.approx(lasting, abs=0.05)
