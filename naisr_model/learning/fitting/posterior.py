"""How sure a fit is: a Gaussian about it with the curvature of the least-squares objective (Laplace).

The parameters theta are the inferred covariates and the whitened code. A surface point moves along
its normal by -dr/dtheta . dtheta, so the Jacobian of the distances gives what the covariance of theta
means for the surface and for the volume that it encloses.

At other covariates another day is meant. Whitened codes w of two visits of a person are taken for standard
normal, all their elements with one correlation rho, so that of one the other is known to be rho w with the
variance 1 - rho^2. rho is that of the codes z of the training population's visits, all directions together.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from naisr_model.learning.fitting.evidence import ShapeFit
from naisr_model.learning.fitting.least_squares import (
    FOLLOWED_POINTS,
    INDEPENDENT_POINTS,
    Problem,
    evaluate,
    linearise,
)
from naisr_model.learning.fitting.prior import Prior
from naisr_model.learning.fitting.target import Sample, Target, draw_sample
from naisr_model.models.base import ShapeModel

Vector = NDArray[np.float64]

POINTS, SEED = 1024, 1000
"""Surface points of the patient that the precision is taken from; not those of the fit."""

INDEPENDENT_OFFSETS = 20.0
"""As many independent offsets of a surface, each of the noise, make the error of its volume: what the atlas
cannot express is alike over centimetres. Chosen over 31 synthetic patients of both shipped atlases, of other
seeds than those of the training and of ``naisr evaluate calibration``."""

ONE_DAY = 0.1
"""Standard deviations of the covariates, about, over which what sets a person apart on one day gives way to
what lasts. Codes of training visits 0.1 to 0.2 apart are no more alike than those of visits farther apart."""

SAME = 1e-6
"""Covariates closer than this are the same: real units and back cost the last digits."""

TWO_SIDED_95 = 1.959964


@dataclass(frozen=True, eq=False)
class Posterior:
    """A Gaussian over the parameters of one fitted shape.

    Attributes:
        covariates: centred, of the shape, ``[N]``.
        problem: which covariates are free, and the prior.
        covariance: of free covariates (centred) and whitened code, ``[P, P]``.
        along: the part of it that shows on the surface: what the patient's points leave open of the shape
            itself, however covariates and code share it, ``[P, P]``.
        noise: standard deviation of what the atlas cannot express, model units.
    """

    covariates: Vector
    problem: Problem
    covariance: Vector
    along: Vector
    noise: float


def posterior_of(model: ShapeModel, target: Target, prior: Prior, fit: ShapeFit) -> Posterior:
    """The Gaussian about a fit to ``target``."""
    fixed = fit.covariates.copy()
    fixed[fit.free] = np.nan
    problem = Problem(model, prior, fixed, INDEPENDENT_POINTS)
    parameters = problem.pack(fit.covariates, fit.latent)
    rows = evaluate(problem, draw_sample(target, POINTS, SEED), parameters)
    # Of a part, what was not seen is no surer than the code.
    surface_points = FOLLOWED_POINTS if len(target.space) else INDEPENDENT_POINTS
    believed, followed = (
        linearise(dataclasses.replace(problem, independent=points), rows, parameters, rows.noise).hessian
        for points in (INDEPENDENT_POINTS, surface_points)
    )
    along = np.asarray(np.linalg.inv(followed), dtype=np.float64)
    joint = _joint_covariance(fit.spread, believed)
    return Posterior(fit.covariates, problem, joint, along, rows.noise)


def _joint_covariance(spread: Vector, precision: Vector) -> Vector:
    """Covariances of the free covariates as given, and of the code given them from the joint precision."""
    count = len(spread)
    within = np.linalg.inv(precision[count:, count:])
    along = -within @ precision[count:, :count]
    across = spread @ along.T
    return np.block([[spread, across], [across.T, within + along @ across]])


def remaining(posterior: Posterior, covariates: Vector) -> float:
    """How much of the code is expected of the same person at other covariates, hence on another day.

    1 at the covariates of the fit; far away the correlation of two visits' codes, which makes it the best
    linear prediction of one visit from another.
    """
    lost = 1 - posterior.problem.prior.lasting
    return 1 - lost * (1 - nearness(posterior, covariates))


def nearness(posterior: Posterior, covariates: Vector) -> float:
    """How nearly other covariates are those of the same day, 0 to 1; exactly 1 at those of the fit."""
    away = float(np.linalg.norm(covariates - posterior.covariates))
    return 1.0 if away < SAME else float(np.exp(-away / ONE_DAY))


def moved(posterior: Posterior, covariates: Vector) -> Posterior:
    """The same person at other covariates, all of them given.

    The farther away, the less the patient's points pin the surface down, and the less is known of the code:
    what does not remain of it is as open as that of a stranger. At the covariates of the fit itself nothing
    changes.
    """
    near, share = nearness(posterior, covariates), remaining(posterior, covariates)
    if near == 1:
        return posterior
    count = len(posterior.problem.free)
    here, there = (matrix[count:, count:] for matrix in (posterior.along, posterior.covariance))
    known = here + (1 - near) * (there - here)
    code = share**2 * known + (1 - share**2) * np.eye(len(here))
    problem = dataclasses.replace(posterior.problem, fixed=covariates)
    return Posterior(covariates, problem, code, code, posterior.noise)


def surface_offsets(
    posterior: Posterior, points: NDArray[np.float32], covariates: Vector, latent: Vector
) -> Vector:
    """How the surface may lie at its ``points [n, dim]``, model units along the normal, ``[P, n]``.

    Each row is one offset of the whole surface by a standard deviation, independent of the others; what the
    atlas cannot express is not among them.
    """
    jacobian = _jacobian(posterior, points, covariates, latent)
    return np.asarray(-(jacobian @ np.linalg.cholesky(posterior.along)).T)


def surface_deviations(
    posterior: Posterior, points: NDArray[np.float32], covariates: Vector, latent: Vector
) -> Vector:
    """Standard deviation of the surface along its normal at its ``points [n, dim]``, model units, ``[n]``.

    What the atlas cannot express is part of it.
    """
    offsets = surface_offsets(posterior, points, covariates, latent)
    return np.sqrt(np.sum(offsets**2, axis=0) + posterior.noise**2)


def volume_deviation(
    posterior: Posterior, points: NDArray[np.float32], area: float, covariates: Vector, latent: Vector
) -> float:
    """Standard deviation of the enclosed volume, model units to the power ``dim``.

    dV is the integral of the normal displacement over the surface. What the atlas cannot express adds
    as many independent offsets as the surface counts for.

    Args:
        posterior: of the parameters.
        points: spread evenly over the surface, ``[n, dim]``.
        area: of the surface.
        covariates: centred, of the surface, ``[N]``.
        latent: of the surface, ``[L]``.
    """
    slope = -area * _jacobian(posterior, points, covariates, latent).mean(axis=0)
    unexplained = (posterior.noise * area) ** 2 / INDEPENDENT_OFFSETS
    return float(np.sqrt(slope @ posterior.along @ slope + unexplained))


def _jacobian(
    posterior: Posterior, points: NDArray[np.float32], covariates: Vector, latent: Vector
) -> Vector:
    sample = Sample(torch.as_tensor(points), torch.zeros(len(points)))
    return evaluate(posterior.problem, sample, posterior.problem.pack(covariates, latent)).jacobian
