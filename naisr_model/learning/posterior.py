"""How sure a fit is: a Gaussian about it with the curvature of the least-squares objective (Laplace).

The parameters theta are the inferred covariates and the whitened code. A surface point moves along
its normal by -dr/dtheta . dtheta, so the Jacobian of the distances gives what the covariance of theta
means for the surface and for the volume that it encloses.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from naisr_model.learning.fit import FOLLOWED_POINTS, INDEPENDENT_POINTS, ShapeFit, draw_sample
from naisr_model.learning.least_squares import Problem, Sample, evaluate, linearise
from naisr_model.learning.prior import Prior
from naisr_model.learning.target import Target
from naisr_model.networks.naisr import Naisr

Vector = NDArray[np.float64]

POINTS, SEED = 1024, 1000
"""Surface points of the patient that the precision is taken from; not those of the fit."""

INDEPENDENT_OFFSETS = 20.0
"""As many independent offsets of a surface, each of the noise, make the error of its volume: what the atlas
cannot express is alike over centimetres. Chosen over 31 synthetic patients of both shipped atlases, of other
seeds than those of the training and of ``naisr evaluate calibration``."""

LASTING = 0.25
"""Standard deviations of the covariates over which a code ceases to be the same; a choice, not a measurement.
Codes of two visits of one child in the shipped airway atlas correlate with 0.2 at most."""

SAME = 1e-6
"""Covariates closer than this are the same."""

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


def posterior_of(network: Naisr, target: Target, prior: Prior, fit: ShapeFit) -> Posterior:
    """The Gaussian about a fit to ``target``."""
    fixed = fit.covariates.copy()
    fixed[fit.free] = np.nan
    problem = Problem(network, prior, fixed, INDEPENDENT_POINTS)
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


def moved(posterior: Posterior, covariates: Vector) -> Posterior:
    """The same person at other covariates, all of them given.

    The farther away, the less the patient's points pin the surface down, and the less the code itself can
    be taken for the same: what visits of one person differ by is added to what is open about it. At the
    covariates of the fit itself nothing changes.
    """
    away = float(np.linalg.norm(covariates - posterior.covariates))
    if away < SAME:
        return posterior
    count, prior = len(posterior.problem.free), posterior.problem.prior
    here = posterior.along[count:, count:]
    there = posterior.covariance[count:, count:] + prior.change * np.eye(len(here))
    code = here + (1 - np.exp(-away / LASTING)) * (there - here)
    problem = dataclasses.replace(posterior.problem, fixed=covariates)
    return Posterior(covariates, problem, code, code, posterior.noise)


def surface_deviations(
    posterior: Posterior, points: NDArray[np.float32], covariates: Vector, latent: Vector
) -> Vector:
    """Standard deviation of the surface along its normal at its ``points [n, dim]``, model units, ``[n]``.

    What the atlas cannot express is part of it.
    """
    jacobian = _jacobian(posterior, points, covariates, latent)
    explained = np.einsum("np,pq,nq->n", jacobian, posterior.along, jacobian)
    return np.sqrt(explained + posterior.noise**2)


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
