"""The search: descents that only go down, starts all over the population, few evaluations."""

import numpy as np

from naisr_model.learning.fitting.least_squares import Descent, descend, evaluate, linearise
from naisr_model.learning.fitting.rescue import rescued
from naisr_model.learning.fitting.search import STAGES, fit_shape
from naisr_model.learning.fitting.starts import STARTS, spread
from naisr_model.learning.fitting.target import target_of
from naisr_model.progress import SILENT


def test_a_descent_never_goes_up_and_stays_in_range(lost):
    problem, sample, start = lost
    rows = evaluate(problem, sample, start)
    end = descend(problem, sample, start, 6)
    before = linearise(problem, rows, start, rows.noise).objective
    assert linearise(problem, end.rows, end.parameters, rows.noise).objective < before
    assert problem.prior.lowest[0] <= end.parameters[0] <= problem.prior.highest[0]
    assert problem.bounded(np.full(5, 99.0))[0] == problem.prior.highest[0]


def test_adam_helps_where_least_squares_stall(lost):
    problem, sample, start = lost
    rows = evaluate(problem, sample, start)
    end = rescued(problem, sample, Descent(start, rows, 0, stalled=True), 4, SILENT)
    assert (
        linearise(problem, end.rows, end.parameters, rows.noise).objective
        < linearise(problem, rows, start, rows.noise).objective
    )


def test_a_fit_costs_few_evaluations(atlas, made, prior):
    target = target_of(made[2], atlas.frame)
    result = fit_shape(atlas.checkpoint.model(), target, prior, np.array([0.5, 1.0]))[0]
    # Levenberg-Marquardt takes some steps where the paper's procedure takes 800 of 750 points.
    assert result.evaluations <= 1.25 * 5 * sum(STAGES) < 0.05 * 800 * 750


def test_unknown_covariates_are_tried_all_over_the_population(lost):
    ages = np.array([place[0] for place in spread(lost[0])])
    observed = lost[0].prior.training[:, 0]
    assert len(ages) == STARTS and {observed.min(), observed.max()} <= set(ages)
    assert np.diff(np.sort(ages)).max() < 0.5
