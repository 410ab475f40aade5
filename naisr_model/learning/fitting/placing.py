"""Where a patient lies: its rigid motion sought together with the code and the unknown covariates.

A point x that is turned by a small a about m and shifted by t comes to lie a x (x - m) + t farther, and its
distance to the shape grows by

    dr = n . (a x (x - m) + t) = a . ((x - m) x n) + t . n,   n = grad Phi / |grad Phi|.

These six columns stand beside those of the parameters in every Gauss-Newton step. The motion has no prior:
what the shape model finds improbable of a person is rather explained by where the person lies.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from naisr_model.learning.fitting.least_squares import (
    EASED,
    FIRST_DAMPING,
    STIFFENED,
    Problem,
    Rows,
    evaluate,
    linearise,
    weights_of,
)
from naisr_model.learning.fitting.target import Sample
from naisr_model.progress import SILENT, Progress

Vector = NDArray[np.float64]

STEPS, STIFFEST = 40, 1e6
"""At most so many steps are tried, and up to this damping."""

SETTLED = 1e-4
"""Model units: a step that moves no point farther is the last one."""


@dataclass(frozen=True, eq=False)
class Placing:
    """Where a patient is explained best.

    Attributes:
        motion: rigid, ``[dim + 1, dim + 1]``, from where it lies.
        moved: mean distance by which the motion carries its points.
        before: mean distance of its points to the fitted surface as it lies.
        after: the same once it is moved, code and covariates following.
    """

    motion: Vector
    moved: float
    before: float
    after: float


@dataclass(frozen=True, eq=False)
class _Place:
    """Somewhere on the way.

    Attributes:
        motion: made so far, ``[dim + 1, dim + 1]``.
        parameters: see :class:`~naisr_model.learning.fitting.least_squares.Problem`, ``[P]``.
        points: of the sample, moved, ``[n, dim]``.
        rows: the residuals there.
    """

    motion: Vector
    parameters: Vector
    points: Vector
    rows: Rows

    @property
    def distance(self) -> float:
        """Mean distance of the points on the surface."""
        return float(np.abs(self.rows.residuals[self.rows.surface]).mean())


def placing_of(problem: Problem, sample: Sample, parameters: Vector, progress: Progress = SILENT) -> Placing:
    """Where a patient is explained best, in model units.

    Args:
        problem: which covariates are free besides the code.
        sample: of the patient as it lies.
        parameters: of its fit there, ``[P]``.
        progress: checked before every step.

    Raises:
        Cancelled: when nobody waits for it any more.
    """
    start = here = _place(problem, sample, np.eye(sample.points.shape[1] + 1), parameters)
    damping = FIRST_DAMPING
    for _ in range(STEPS):
        progress.check()
        there = _stepped(problem, sample, here, damping)
        noise = here.rows.noise
        before, after = (
            linearise(problem, place.rows, place.parameters, noise).objective for place in (here, there)
        )
        if after < before:
            moved = np.linalg.norm(there.points - here.points, axis=1).max()
            here, damping = there, damping * EASED
            if moved < SETTLED:
                break
        elif (damping := damping * STIFFENED) > STIFFEST:
            break
    far = np.linalg.norm(here.points - start.points, axis=1)[here.rows.surface].mean()
    return Placing(here.motion, float(far), start.distance, here.distance)


def _place(problem: Problem, sample: Sample, motion: Vector, parameters: Vector) -> _Place:
    points = sample.points.double().numpy() @ motion[:-1, :-1].T + motion[:-1, -1]
    lies = Sample(torch.as_tensor(points).to(sample.points), sample.distances)
    return _Place(motion, parameters, points, evaluate(problem, lies, parameters))


def _stepped(problem: Problem, sample: Sample, here: _Place, damping: float) -> _Place:
    """A damped step of motion and parameters together."""
    rows, middle = here.rows, here.points.mean(axis=0)
    near = linearise(problem, rows, here.parameters, rows.noise)
    arms = here.points - middle
    by_motion = np.hstack([_torques(arms, rows.by_place), rows.by_place])
    free = by_motion.shape[1]
    weighted = by_motion.T * weights_of(problem, rows.residuals, rows.noise)
    across = weighted @ rows.jacobian
    hessian = np.block([[weighted @ by_motion, across], [across.T, near.hessian]])
    gradient = np.concatenate([weighted @ rows.residuals, near.gradient])
    step = -np.linalg.solve(hessian + damping * np.diag(np.diag(hessian)), gradient)
    turn, shift = np.split(step[:free], [free - len(middle)])
    motion = _rigid(turn, shift, middle) @ here.motion
    return _place(problem, sample, motion, problem.bounded(here.parameters + step[free:]))


def _torques(arms: Vector, forces: Vector) -> Vector:
    """``arms x forces``, ``[n, 3]``; in the plane the one component across it, ``[n, 1]``."""
    if arms.shape[1] == 3:
        return np.cross(arms, forces)
    return arms[:, :1] * forces[:, 1:] - arms[:, 1:] * forces[:, :1]


def _rigid(turn: Vector, shift: Vector, middle: Vector) -> Vector:
    """A turn about ``middle``, then a shift, as a matrix ``[dim + 1, dim + 1]``.

    The turn is a rotation vector, in the plane its one component across it.
    """
    dim = len(middle)
    across = np.array([0.0, 0.0, turn[0]]) if dim == 2 else turn
    motion = np.eye(dim + 1)
    motion[:dim, :dim] = Rotation.from_rotvec(across).as_matrix()[:dim, :dim]
    motion[:dim, dim] = middle + shift - motion[:dim, :dim] @ middle
    return motion
