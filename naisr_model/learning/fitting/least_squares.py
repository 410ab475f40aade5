"""The negative log posterior of one shape's parameters, linearised, and damped Gauss-Newton steps on it.

The parameters are the free covariates (centred) and the whitened code w, z = B w. With r_i the
first-order distance of sample i minus its true distance,

    E = (M / n sigma^2) sum_i rho(r_i) + |w|^2 + (c - mu)^T P (c - mu),   rho(r) = r^2 / (1 + r^2 / k^2),

which is twice the negative logarithm of the posterior when the n residuals say as much as M
independent ones of standard deviation sigma. Most of a residual is what the atlas cannot express,
and that is alike over centimetres of a surface however many points are taken from it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from naisr_model.learning.fitting.prior import Prior, conditional
from naisr_model.learning.fitting.sensitivity import sensitivity
from naisr_model.learning.fitting.target import Sample
from naisr_model.models.base import ShapeModel
from naisr_model.progress import SILENT, Progress

Vector = NDArray[np.float64]

TOLERATED = 4.0
"""k in standard deviations: residuals far beyond it lose their say (Geman-McClure)."""

REACH = 0.05
"""Model units beyond which an error of a distance counts relative to the distance."""

SMALLEST_NOISE = 2e-4
"""Model units; residuals below it are rounding and sampling, not shape."""

SETTLED = 1e-2
"""A step that lowers the objective by less than this share is the last one."""

FIRST_DAMPING, EASED, STIFFENED = 1e-2, 0.1, 10.0

INDEPENDENT_POINTS = 5.0
"""M for what is inferred with its uncertainty: so few because what the atlas cannot express looks like a
change of covariates over the whole shape. Chosen over 60 synthetic patients of each shipped atlas, of other
seeds than those of the training and of ``naisr evaluate calibration``, which counts how often the intervals
hold the truth."""

FOLLOWED_POINTS = 500.0
"""M for the code once the covariates are settled: the fitted surface should follow the patient's more
closely than one would bet on the code."""


@dataclass(frozen=True, eq=False)
class Problem:
    """One shape's unknowns.

    Attributes:
        model: trained, not changed.
        prior: of codes and covariates.
        fixed: centred values of the covariates that do not move, NaN for the free ones, ``[N]``.
        independent: M, how many independent measurements the surface counts for.
        tolerated: k, see :data:`TOLERATED`.
    """

    model: ShapeModel
    prior: Prior
    fixed: Vector
    independent: float
    tolerated: float = TOLERATED

    @property
    def free(self) -> NDArray[np.intp]:
        """Columns of the free covariates."""
        return np.flatnonzero(np.isnan(self.fixed))

    def pack(self, covariates: Vector, latent: Vector) -> Vector:
        """Parameters of covariates ``[N]`` and a code ``[L]``."""
        return np.concatenate([covariates[self.free], np.linalg.solve(self.prior.code_root, latent)])

    def unpack(self, parameters: Vector) -> tuple[Vector, Vector]:
        """Covariates ``[N]`` and code ``[L]`` of parameters."""
        covariates, count = self.fixed.copy(), len(self.free)
        covariates[self.free] = parameters[:count]
        return covariates, self.prior.code_root @ parameters[count:]

    def bounded(self, parameters: Vector) -> Vector:
        """The nearest parameters inside the observed ranges."""
        result, free = parameters.copy(), self.free
        inside = np.clip(result[: len(free)], self.prior.lowest[free], self.prior.highest[free])
        result[: len(free)] = inside
        return result


@dataclass(frozen=True, eq=False)
class Quadratic:
    """The objective about some parameters.

    Attributes:
        objective: E.
        gradient: half of dE, ``[P]``.
        hessian: half of the Gauss-Newton Hessian: the precision of the posterior, ``[P, P]``.
    """

    objective: float
    gradient: Vector
    hessian: Vector


class Rows(NamedTuple):
    """Residuals ``[n]`` of a sample in model units and their derivatives by the parameters ``[n, P]``.

    ``surface [n]`` is true for points on the surface; ``by_place [n, dim]`` are the derivatives by where the
    point itself lies.
    """

    residuals: Vector
    jacobian: Vector
    surface: NDArray[np.bool_]
    by_place: Vector

    @property
    def noise(self) -> float:
        """Robust standard deviation of the residuals on the surface."""
        return max(SMALLEST_NOISE, 1.4826 * float(np.median(np.abs(self.residuals[self.surface]))))


def evaluate(problem: Problem, sample: Sample, parameters: Vector) -> Rows:
    """The only place where the networks are evaluated."""
    covariates = len(problem.fixed)
    vectors = [torch.as_tensor(part).to(sample.points) for part in problem.unpack(parameters)]
    local = sensitivity(problem.model, sample.points, *vectors)
    scale = 1 / (1 + sample.distances.abs() / REACH)
    residuals = (local.distances - sample.distances) * scale
    by_all = (local.jacobian * scale[:, None]).double().numpy(force=True)
    by_code = by_all[:, covariates:] @ problem.prior.code_root
    return Rows(
        residuals.double().numpy(force=True),
        np.hstack([by_all[:, problem.free], by_code]),
        (sample.distances == 0).numpy(force=True),
        (local.normals * scale[:, None]).double().numpy(force=True),
    )


def linearise(problem: Problem, rows: Rows, parameters: Vector, noise: float) -> Quadratic:
    """E and its derivatives at ``parameters [P]`` for residuals of standard deviation ``noise``."""
    residuals, jacobian = rows.residuals, rows.jacobian
    weighted = jacobian.T * weights_of(problem, residuals, noise)
    offset, precision = _prior_terms(problem, parameters)
    return Quadratic(
        objective=_misfit(problem, residuals, noise) + float(offset @ precision @ offset),
        gradient=weighted @ residuals + precision @ offset,
        hessian=weighted @ jacobian + precision,
    )


def weights_of(problem: Problem, residuals: Vector, noise: float) -> Vector:
    """Half of what dE adds for each residual, over that residual, ``[n]``."""
    squared = (residuals / (problem.tolerated * noise)) ** 2
    return _share(problem, residuals, noise) / (1 + squared) ** 2


def _misfit(problem: Problem, residuals: Vector, noise: float) -> float:
    """E without the prior."""
    squared = (residuals / (problem.tolerated * noise)) ** 2
    return float(_share(problem, residuals, noise) * (residuals**2 / (1 + squared)).sum())


def _share(problem: Problem, residuals: Vector, noise: float) -> float:
    return problem.independent / (len(residuals) * noise**2)


def _prior_terms(problem: Problem, parameters: Vector) -> tuple[Vector, Vector]:
    """Offset from the prior mean ``[P]`` and the prior precision ``[P, P]``."""
    mean, precision = conditional(problem.prior, problem.fixed)
    offset, whole = parameters.copy(), np.eye(len(parameters))
    offset[: len(mean)] -= mean
    whole[: len(mean), : len(mean)] = precision
    return offset, whole


@dataclass(frozen=True, eq=False)
class Descent:
    """Where a descent ended.

    Attributes:
        parameters: the best ones.
        rows: the residuals there.
        evaluations: points at which the networks were evaluated.
        stalled: no step lowered the objective although its gradient promised that.
    """

    parameters: Vector
    rows: Rows
    evaluations: int
    stalled: bool


def descend(
    problem: Problem, sample: Sample, parameters: Vector, steps: int, progress: Progress = SILENT
) -> Descent:
    """At most ``steps`` Levenberg-Marquardt steps on one sample; never worse than the start.

    The noise is that of the residuals at the start, so it falls from one descent to the next. ``progress``
    is checked before each step; how many there will be nobody can tell.

    Raises:
        Cancelled: when nobody waits for it any more.
    """
    rows, damping, tried, moved = evaluate(problem, sample, parameters), FIRST_DAMPING, 0, False
    noise = rows.noise
    here = linearise(problem, rows, parameters, noise)
    while tried < steps:
        progress.check()
        trial = problem.bounded(parameters + _step(problem, parameters, here, damping))
        trial_rows = evaluate(problem, sample, trial)
        there = linearise(problem, trial_rows, trial, noise)
        tried += 1
        if not there.objective < here.objective:
            damping *= STIFFENED
            continue
        gained = here.objective - there.objective
        parameters, rows, here, damping, moved = trial, trial_rows, there, damping * EASED, True
        if gained < SETTLED * here.objective:
            break
    promised = -here.gradient @ _step(problem, parameters, here, FIRST_DAMPING)
    stalled = not moved and bool(promised > SETTLED * here.objective)
    return Descent(parameters, rows, (tried + 1) * len(sample.points), stalled)


def _step(problem: Problem, parameters: Vector, here: Quadratic, damping: float) -> Vector:
    """The damped step; covariates that push against the end of their range stay there."""
    moving, count = np.ones(len(parameters), bool), len(problem.free)
    value, pull = parameters[:count], -here.gradient[:count]
    low, high = problem.prior.lowest[problem.free], problem.prior.highest[problem.free]
    moving[:count] = ~((value <= low) & (pull < 0) | (value >= high) & (pull > 0))
    hessian = here.hessian[np.ix_(moving, moving)]
    step = np.zeros(len(parameters))
    step[moving] = -np.linalg.solve(hessian + damping * np.diag(np.diag(hessian)), here.gradient[moving])
    return step
