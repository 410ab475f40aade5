"""Adam, for where least squares stall."""

from __future__ import annotations

import dataclasses

import numpy as np

from naisr_model.learning.fitting.least_squares import Descent, Problem, descend, evaluate, linearise
from naisr_model.learning.fitting.target import Sample
from naisr_model.progress import Progress

RESCUE_STEPS, RESCUE_RATE = 60, 0.05
"""Adam steps, in standard deviations of the prior, where least squares stall."""


def rescued(problem: Problem, sample: Sample, descent: Descent, steps: int, progress: Progress) -> Descent:
    """Adam where no damped step would go down, then least squares again; the better of the two ends.

    Args:
        problem: whose descent has stalled.
        sample: on which it did.
        descent: where it ended.
        steps: at most so many of least squares.
        progress: checked before every step.

    Raises:
        Cancelled: when nobody waits for it any more.
    """
    parameters, noise = descent.parameters, descent.rows.noise
    first, second = np.zeros_like(parameters), np.zeros_like(parameters)
    for step in range(1, RESCUE_STEPS + 1):
        progress.check()
        rows = evaluate(problem, sample, parameters)
        gradient = linearise(problem, rows, parameters, noise).gradient
        first, second = 0.9 * first + 0.1 * gradient, 0.99 * second + 0.01 * gradient**2
        ratio = first / (1 - 0.9**step) / (np.sqrt(second / (1 - 0.99**step)) + 1e-12)
        parameters = problem.bounded(parameters - RESCUE_RATE * (1 - step / (RESCUE_STEPS + 1)) * ratio)
    again = descend(problem, sample, parameters, steps, progress)
    before, after = (
        linearise(problem, end.rows, end.parameters, noise).objective for end in (descent, again)
    )
    spent = descent.evaluations + again.evaluations + RESCUE_STEPS * len(sample.points)
    return dataclasses.replace(again if after < before else descent, evaluations=spent)
