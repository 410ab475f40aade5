"""Where there are data."""

from __future__ import annotations

import numpy as np

from naisr_viewer.views.covariates.histogram import bin_counts


def test_the_histogram_counts_everybody(card):
    for covariate in card.covariates:
        observed = card.population.observed(covariate.name)
        assert bin_counts(covariate, observed).sum() == len(observed)
    assert len(bin_counts(card.covariates[2], np.array([-1.0, -1.0, 1.0]))) == 2
