"""Points that follow a velocity for one unit of time; where it is smooth, no two of them ever meet."""

from __future__ import annotations

from torch import Tensor
from torchdiffeq import odeint

from naisr_model.models.base import PointFunction


def flowed(velocity: PointFunction, points: Tensor, steps: int) -> Tensor:
    """Where points are at time 1 that begin at time 0 and go with a stationary velocity.

    By the classical Runge-Kutta method, differentiable as often as the velocity is.

    Args:
        velocity: of points ``[..., dim]``, model units.
        points: ``[..., dim]``.
        steps: in which time goes from 0 to 1.
    """
    ends = points.new_tensor([0.0, 1.0])
    ways = odeint(
        lambda _, here: velocity(here), points, ends, method="rk4", options={"step_size": 1 / steps}
    )
    end: Tensor = ways[-1]
    return end
