"""How sure a fit is: a Gaussian about it with the curvature of the least-squares objective (Laplace).

The parameters theta are the inferred covariates and the whitened code. A surface point moves along
its normal by -dr/dtheta . dtheta, so the Jacobian of the distances gives what the covariance of theta
means for the surface and for the volume that it encloses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from naisr_model.learning.fit import INDEPENDENT_POINTS, ShapeFit, draw_sample
from naisr_model.learning.least_squares import Problem, Sample, evaluate, linearise
from naisr_model.learning.prior import Prior
from naisr_model.learning.target import Target
from naisr_model.networks.naisr import Naisr

Vector = NDArray[np.float64]

POINTS, SEED = 1024, 1000
"""Surface points of the patient that the precision is taken from; not those of the fit."""

TWO_SIDED_95 = 1.959964


@dataclass(frozen=True, eq=False)
class Posterior:
    """A Gaussian over the parameters of one fitted shape.

    Attributes:
        problem: which covariates are free, and the prior.
        covariance: of free covariates (centred) and whitened code, ``[P, P]``.
        noise: standard deviation of what the atlas cannot express, model units.
    """

    problem: Problem
    covariance: Vector
    noise: float

    @property
    def covariate_deviations(self) -> Vector:
        """Standard deviations of all centred covariates, 0 for the known ones, ``[N]``."""
        free, result = self.problem.free, np.zeros(len(self.problem.fixed))
        result[free] = np.sqrt(np.diag(self.covariance)[: len(free)])
        return result


def posterior_of(network: Naisr, target: Target, prior: Prior, fit: ShapeFit) -> Posterior:
    """The Gaussian about a fit to ``target``."""
    fixed = fit.covariates.copy()
    fixed[fit.free] = np.nan
    problem = Problem(network, prior, fixed, INDEPENDENT_POINTS)
    parameters = problem.pack(fit.covariates, fit.latent)
    rows = evaluate(problem, draw_sample(target, POINTS, SEED), parameters)
    precision = linearise(problem, rows, parameters, rows.noise).hessian
    return Posterior(problem, _joint_covariance(fit.spread, precision), rows.noise)


def _joint_covariance(spread: Vector, precision: Vector) -> Vector:
    """Covariances of the free covariates as given, and of the code given them from the joint precision."""
    count = len(spread)
    within = np.linalg.inv(precision[count:, count:])
    along = -within @ precision[count:, :count]
    across = spread @ along.T
    return np.block([[spread, across], [across.T, within + along @ across]])


def moved(posterior: Posterior, covariates: Vector) -> Posterior:
    """The same person at other covariates, all of them given: what is left is the code's uncertainty."""
    count = len(posterior.problem.free)
    problem = Problem(
        posterior.problem.network, posterior.problem.prior, covariates, posterior.problem.independent
    )
    return Posterior(problem, posterior.covariance[count:, count:], posterior.noise)


def surface_deviations(
    posterior: Posterior, points: NDArray[np.float32], covariates: Vector, latent: Vector
) -> Vector:
    """Standard deviation of the surface along its normal at its ``points [n, dim]``, model units, ``[n]``.

    What the atlas cannot express is part of it.
    """
    jacobian = _jacobian(posterior, points, covariates, latent)
    explained = np.einsum("np,pq,nq->n", jacobian, posterior.covariance, jacobian)
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
    unexplained = (posterior.noise * area) ** 2 / posterior.problem.independent
    return float(np.sqrt(slope @ posterior.covariance @ slope + unexplained))


def _jacobian(
    posterior: Posterior, points: NDArray[np.float32], covariates: Vector, latent: Vector
) -> Vector:
    sample = Sample(torch.as_tensor(points), torch.zeros(len(points)))
    return evaluate(posterior.problem, sample, posterior.problem.pack(covariates, latent)).jacobian
