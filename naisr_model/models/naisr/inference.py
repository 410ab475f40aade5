"""One shape at inference: what does not change from point to point is computed once.

The covariates' and the code's share of a layer becomes its bias, and f_i(p, c_i, z) and f_i(p, 0, z)
share their products with the point. The network of a covariate that is exactly 0 displaces nothing and
is left out: Phi_i is Phi with every other covariate at 0, and T is Phi with all of them at 0.
"""

from __future__ import annotations

import torch
from torch import Tensor

from naisr_model.models.base import PointFunction
from naisr_model.models.products import multiply
from naisr_model.models.siren import SirenStack


@torch.inference_mode()
def displacement_function(stack: SirenStack, covariates: Tensor, latent: Tensor) -> PointFunction:
    """sum_i g_i(p, c_i, z) = sum_i f_i(p, c_i, z) - f_i(p, 0, z) of one shape, ``[n, dim]``.

    Args:
        stack: f_1 ... f_N.
        covariates: c, centred, ``[N]``.
        latent: z, ``[L]``.
    """
    active = covariates.nonzero()[:, 0].to(stack.last_bias.device)
    if not len(active):
        return torch.zeros_like
    values = covariates.to(active.device)[active]
    levels = torch.stack([values, torch.zeros_like(values)], dim=1)
    states, last = _last_states(stack, active, levels, latent)

    @torch.inference_mode()
    def displacement(points: Tensor) -> Tensor:
        at_value, at_zero = states(points).unbind(dim=1)
        return torch.bmm(at_value - at_zero, last).sum(dim=0)

    return displacement


@torch.inference_mode()
def effect_function(stack: SirenStack, index: int, values: Tensor, latent: Tensor) -> PointFunction:
    """g_i(p, c_i, z) of one covariate at several of its values, ``[K, n, dim]``.

    Args:
        stack: f_1 ... f_N.
        index: i.
        values: of c_i, centred, ``[K]``.
        latent: z, ``[L]``.
    """
    one = torch.tensor([index], device=stack.last_bias.device)
    levels = torch.cat([values, values.new_zeros(1)])[None].to(one.device)
    states, last = _last_states(stack, one, levels, latent)

    @torch.inference_mode()
    def effect(points: Tensor) -> Tensor:
        state = states(points)[0]
        return (state[:-1] - state[-1:]) @ last[0]

    return effect


def _last_states(
    stack: SirenStack, active: Tensor, levels: Tensor, latent: Tensor
) -> tuple[PointFunction, Tensor]:
    """The last hidden layer of some networks at several values of their covariate.

    Args:
        stack: f_1 ... f_N.
        active: which of them, ``[A]``.
        levels: values of c_i, ``[A, M]``.
        latent: z, ``[L]``.

    Returns:
        A function of points that gives ``[A, M, n, width]``, and the weights ``[A, width, dim]`` of the
        last layer, whose bias cancels in every g_i.
    """
    omega0 = stack.omega0  # the sines' frequency goes into the weights
    heights = levels.to(stack.last_bias)[..., None]
    codes = latent.to(stack.last_bias).expand(*levels.shape, -1)
    first = omega0 * stack.point_weight[active].mT
    conditions = torch.cat([heights, codes], dim=-1) @ stack.condition_weight[active].mT
    first_bias = omega0 * (stack.first_bias[active, None] + conditions)[:, :, None]
    skip = omega0 * stack.skip_point_weight[active].mT
    skip_bias = omega0 * (heights @ stack.skip_condition_weight[active].mT)[:, :, None]
    hidden = omega0 * stack.hidden_weight[:, active].mT
    hidden_bias = omega0 * stack.hidden_bias[:, active]

    def states(points: Tensor) -> Tensor:
        state = ((points @ first)[:, None] + first_bias).sin_()
        for layer, (weight, bias) in enumerate(zip(hidden, hidden_bias, strict=True)):
            linear = multiply(state.flatten(1, 2), weight, bias).view(state.shape)
            if layer == stack.middle:
                linear += (points @ skip)[:, None] + skip_bias
            state = linear.sin_()
        return state

    return states, stack.last_weight[active].mT
