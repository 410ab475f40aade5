"""Sine networks (SIREN, Sitzmann et al. 2020), several of one size evaluated together.

The displacement networks f_1 ... f_N have the same layout, so their weights are stacked and one
batched product serves all of them; the template is a stack of one. What is constant over a shape
(covariate and latent code) enters the first layer as one vector a shape, not one a point.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor, nn

from naisr_model.config import SirenConfig
from naisr_model.models.products import multiply


class _SineAndSlope(torch.autograd.Function):
    """sin and cos of the same angle, each the other's derivative.

    They are kept for the backward pass, so that however often one differentiates, only two
    trigonometric functions an element are evaluated; on a CPU they cost as much as the products.
    """

    @staticmethod
    def forward(ctx: Any, angle: Tensor) -> tuple[Tensor, Tensor]:
        ctx.set_materialize_grads(False)
        sine, cosine = torch.sin(angle), torch.cos(angle)
        ctx.save_for_backward(sine, cosine)
        return sine, cosine

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor | None) -> Any:
        sine, cosine = ctx.saved_tensors
        of_sine, of_cosine = gradients
        result = None if of_sine is None else of_sine * cosine
        if of_cosine is None:
            return result
        return -of_cosine * sine if result is None else torch.addcmul(result, of_cosine, sine, value=-1)


def sine_and_slope(angle: Tensor) -> tuple[Tensor, Tensor]:
    """sin(angle) and its derivative cos(angle), both differentiable."""
    return _SineAndSlope.apply(angle)


def sine(angle: Tensor) -> Tensor:
    """sin(angle), the activation of every layer; the cheap form where no gradient is wanted."""
    return sine_and_slope(angle)[0] if torch.is_grad_enabled() else angle.sin_()


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
        return self._evaluate(points, conditions, sine)

    def traced(self, points: Tensor, conditions: Tensor | None = None) -> tuple[Tensor, list[Tensor]]:
        """As :meth:`forward`, with the slopes of every layer that :meth:`pulled_back` needs."""
        slopes = []

        def activation(angle: Tensor) -> Tensor:
            value, slope = sine_and_slope(angle)
            slopes.append(slope)
            return value

        return self._evaluate(points, conditions, activation), slopes

    def pulled_back(self, cotangent: Tensor, slopes: list[Tensor]) -> Tensor:
        """The outputs' Jacobian with respect to the points, transposed, times ``cotangent``.

        The chain rule written out layer by layer: its result is differentiable like any other, and one
        backward pass then serves a loss that contains spatial gradients.

        Args:
            cotangent: ``[stack, shapes, n, outputs]``.
            slopes: from :meth:`traced`.

        Returns:
            ``[stack, shapes, n, dim]``.
        """
        stack, shapes, count, _ = cotangent.shape
        again: Tensor | None = None
        state = multiply(cotangent.reshape(stack, shapes * count, -1), self.last_weight)
        for layer, weight in reversed(list(enumerate(self._hidden_weights()))):
            state = state * slopes[layer + 1]
            if layer == self.middle and self.skip_point_weight.shape[-1]:
                again = multiply(state, self.omega0 * self.skip_point_weight)
            state = multiply(state, weight)
        result = multiply(state * slopes[0], self.omega0 * self.point_weight)
        return (result if again is None else result + again).reshape(stack, shapes, count, -1)

    def _evaluate(
        self, points: Tensor, conditions: Tensor | None, activation: Callable[[Tensor], Tensor]
    ) -> Tensor:
        points = points.expand(len(self.point_weight), *points.shape[-3:])
        stack, shapes, count, _ = points.shape
        state = activation(self._affine(points, self.point_weight, self._first_bias(conditions)))
        biases = (self.omega0 * self.hidden_bias).unbind()
        for layer, (weight, bias) in enumerate(zip(self._hidden_weights(), biases, strict=True)):
            linear = multiply(state, weight.mT, bias)
            if layer == self.middle and conditions is not None and self.skip_condition_weight.shape[-1]:
                linear += self._skip(points, conditions)
            state = activation(linear)
        output = multiply(state, self.last_weight.mT, self.last_bias)
        return output.reshape(stack, shapes, count, -1)

    def _hidden_weights(self) -> tuple[Tensor, ...]:
        """One ``[stack, width, width]`` a layer, the frequency of the sines included."""
        return (self.omega0 * self.hidden_weight).unbind()

    def _first_bias(self, conditions: Tensor | None) -> Tensor:
        bias = self.first_bias[:, None]
        if conditions is None:
            return bias
        return torch.baddbmm(bias, conditions, self.condition_weight.mT)

    def _skip(self, points: Tensor, conditions: Tensor) -> Tensor:
        skipped = conditions[..., : self.skip_condition_weight.shape[-1]]
        return self._affine(points, self.skip_point_weight, skipped @ self.skip_condition_weight.mT)

    def _affine(self, points: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
        """``omega0 (weight @ point + bias)`` with one bias a shape: ``[stack, shapes * n, width]``."""
        stack, shapes, count, dim = points.shape
        linear = multiply(points.reshape(stack, shapes * count, dim), self.omega0 * weight.mT)
        linear.view(stack, shapes, count, -1).add_(self.omega0 * bias[:, :, None])
        return linear


def _uniform(bound: float, *shape: int) -> nn.Parameter:
    return nn.Parameter(torch.empty(shape).uniform_(-bound, bound))
