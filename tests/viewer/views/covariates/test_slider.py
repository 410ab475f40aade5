"""Positions of a slider and what they stand for."""

from __future__ import annotations

import numpy as np

from naisr_viewer.views.covariates.slider import SLIDER_STEPS, slider_position, slider_value


def test_slider_positions_and_real_values_agree(card):
    for covariate in card.covariates:
        for value in np.linspace(covariate.range[0], covariate.range[1], 7):
            position = slider_position(covariate, value)
            step = (covariate.range[1] - covariate.range[0]) / SLIDER_STEPS
            assert abs(slider_value(covariate, position) - value) <= step
