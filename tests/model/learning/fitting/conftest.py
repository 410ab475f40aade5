"""An atlas, a shape that it makes, and a problem with that shape."""

from __future__ import annotations

import numpy as np
import pytest

from naisr_model.atlas import Atlas
from naisr_model.learning.fitting.least_squares import Problem
from naisr_model.learning.fitting.prior import Prior, prior_of
from naisr_model.learning.fitting.target import draw_sample, target_of


@pytest.fixture(scope="module")
def atlas(egg_atlas) -> Atlas:
    return Atlas.load(egg_atlas)


@pytest.fixture(scope="module")
def made(atlas):
    """A shape that the atlas makes itself, at known covariates and a known code."""
    values, code = {"age": 6.5, "sex": 1.0}, atlas.checkpoint.latents[3]
    return values, code, atlas.shape(values, code, 64)


@pytest.fixture(scope="module")
def prior(atlas) -> Prior:
    return prior_of(atlas.population, atlas.checkpoint.latents)


@pytest.fixture(scope="module")
def lost(atlas, made, prior):
    """A problem with the age to be found, far from its solution: problem, sample and parameters."""
    problem = Problem(atlas.checkpoint.model(), prior, np.array([np.nan, 1.0]), 6.0)
    sample = draw_sample(target_of(made[2], atlas.frame), 200, 0)
    return problem, sample, problem.pack(prior.lowest, np.zeros(4))
