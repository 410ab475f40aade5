"""Sine networks (SIREN, Sitzmann et al. 2020), several of one size evaluated together.

The displacement networks f_1 ... f_N have the same layout, so their weights are stacked and one
batched product serves all of them; the template is a stack of one. What is constant over a shape
(covariate and latent code) enters the first layer as one vector a shape, not one a point.
"""

from __future__ import annotations

import math
from typing import Any

import torch
from torch import Tensor, nn

from naisr_model.config import SirenConfig


class _Sine(torch.autograd.Function):
    """sin, as often differentiable as torch's, with the cosine kept for the backward pass.

    Training differentiates twice (the eikonal term). Plain ``torch.sin`` evaluates four trigonometric
    functions an element for that, this two; on a CPU they cost as much as the matrix products.
    """

    @staticmethod
    def forward(ctx: Any, angle: Tensor) -> Tensor:
        sine, cosine = torch.sin(angle), torch.cos(angle)
        ctx.save_for_backward(angle, sine, cosine)
        return sine

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> Any:
        return _SineBackward.apply(gradients[0], *ctx.saved_tensors)


class _SineBackward(torch.autograd.Function):
    """``outer * cos(angle)`` with sine and cosine given."""

    @staticmethod
    def forward(ctx: Any, outer: Tensor, angle: Tensor, sine: Tensor, cosine: Tensor) -> Tensor:
        ctx.save_for_backward(outer, angle, sine, cosine)
        return outer * cosine

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> Any:
        outer, angle, sine, cosine = ctx.saved_tensors
        if torch.is_grad_enabled():  # somebody differentiates on: the kept values would be constants
            sine, cosine = torch.sin(angle), torch.cos(angle)
        return gradients[0] * cosine, -(gradients[0] * outer * sine), None, None


def sine(angle: Tensor) -> Tensor:
    """sin(angle), the activation of every layer; the cheap form where no gradient is wanted."""
    return _Sine.apply(angle) if torch.is_grad_enabled() else angle.sin_()


class SirenStack(nn.Module):
    """``stack`` sine MLPs over points of ``dim`` coordinates.

    With ``conditions`` > 0 each network also sees a condition vector a shape. The first
    ``skipped`` entries of that vector, together with the point, feed the middle layer again
    (the paper's skip of (p, c_i)).

    Initialisation: first layer U(-1/D_in, 1/D_in), later layers U(+-sqrt(6/D_in)/omega0). D_in of the
    first layer counts the point and the skipped conditions only: latent codes start near 0, and
    counting their many entries would leave the network almost blind to where it is and to c_i.
    ``output_scale`` shrinks the last layer, so that a network can start near 0.
    """

    def __init__(
        self,
        config: SirenConfig,
        stack: int,
        dim: int,
        outputs: int,
        conditions: int = 0,
        skipped: int = 0,
        output_scale: float = 1.0,
    ) -> None:
        super().__init__()
        self.omega0 = config.omega0
        self.middle = config.hidden // 2
        width = config.width
        first = 1 / (dim + skipped)
        later = math.sqrt(6 / width) / config.omega0
        self.point_weight = _uniform(first, stack, width, dim)
        self.condition_weight = _uniform(first, stack, width, conditions)
        self.first_bias = _uniform(first, stack, width)
        self.hidden_weight = _uniform(later, config.hidden, stack, width, width)
        self.hidden_bias = _uniform(1 / math.sqrt(width), config.hidden, stack, width)
        self.skip_point_weight = _uniform(later, stack, width, dim if skipped else 0)
        self.skip_condition_weight = _uniform(later, stack, width, skipped)
        self.last_weight = _uniform(output_scale * later, stack, outputs, width)
        self.last_bias = _uniform(1 / math.sqrt(width), stack, outputs)

    def forward(self, points: Tensor, conditions: Tensor | None = None) -> Tensor:
        """Evaluate every network of the stack.

        Args:
            points: ``[shapes, n, dim]`` model units, seen by every network, or
                ``[stack, shapes, n, dim]``.
            conditions: ``[stack, shapes, conditions]``.

        Returns:
            ``[stack, shapes, n, outputs]``.
        """
        points = points.expand(len(self.point_weight), *points.shape[-3:])
        stack, shapes, count, _ = points.shape
        first = self._affine(
            points, self.omega0 * self.point_weight, self.omega0 * self._first_bias(conditions)
        )
        state = sine(first).reshape(stack, shapes * count, -1)
        for layer in range(len(self.hidden_weight)):
            weight = self.omega0 * self.hidden_weight[layer]
            bias = (self.omega0 * self.hidden_bias[layer])[:, None]
            linear = torch.baddbmm(bias, state, weight.mT)
            if layer == self.middle and conditions is not None:
                linear = linear + self._skip(points, conditions).reshape(linear.shape)
            state = sine(linear)
        output = torch.baddbmm(self.last_bias[:, None], state, self.last_weight.mT)
        return output.reshape(stack, shapes, count, -1)

    def _first_bias(self, conditions: Tensor | None) -> Tensor:
        bias = self.first_bias[:, None]
        if conditions is None:
            return bias
        return torch.baddbmm(bias, conditions, self.condition_weight.mT)

    def _skip(self, points: Tensor, conditions: Tensor) -> Tensor:
        skipped = conditions[..., : self.skip_condition_weight.shape[-1]]
        bias = skipped @ self.skip_condition_weight.mT
        return self._affine(points, self.omega0 * self.skip_point_weight, self.omega0 * bias)

    @staticmethod
    def _affine(points: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
        """``weight @ point + bias`` with one bias a shape: ``[stack, shapes, n, width]``."""
        return torch.einsum("kspd,kwd->kspw", points, weight) + bias[:, :, None]


def _uniform(bound: float, *shape: int) -> nn.Parameter:
    return nn.Parameter(torch.empty(shape).uniform_(-bound, bound))
