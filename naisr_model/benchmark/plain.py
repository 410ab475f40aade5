"""The paper's equations written down plainly: the truth that the fast code is measured against.

Nothing is shared and nothing is clever: one MLP a network, [p, c_i, z] put together for every point,
f_i at c_i and at 0 as two calls, the losses as the paper prints them, all points at once, and every
derivative by automatic differentiation. It answers the same as
:class:`~naisr_model.models.naisr.network.Naisr` and the paper's terms of
:mod:`~naisr_model.learning.training.objective`, several times slower.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from naisr_model.config import LossWeights, SirenConfig
from naisr_model.learning.training.objective import Batch
from naisr_model.models.naisr.network import Naisr
from naisr_model.models.siren import SirenStack


class PlainSiren(nn.Module):
    """One sine MLP; its middle layer also sees the first ``skipped`` inputs again."""

    def __init__(self, config: SirenConfig, inputs: int, outputs: int, skipped: int = 0) -> None:
        super().__init__()
        self.omega0, self.skipped, self.middle = config.omega0, skipped, config.hidden // 2
        extra = [skipped if layer == self.middle else 0 for layer in range(config.hidden)]
        self.first = nn.Linear(inputs, config.width)
        self.hidden = nn.ModuleList(nn.Linear(config.width + more, config.width) for more in extra)
        self.last = nn.Linear(config.width, outputs)

    def forward(self, inputs: Tensor) -> Tensor:
        """``[n, inputs]`` to ``[n, outputs]``."""
        state = torch.sin(self.omega0 * self.first(inputs))
        for layer, linear in enumerate(self.hidden):
            if layer == self.middle:
                state = torch.cat([state, inputs[:, : self.skipped]], dim=1)
            state = torch.sin(self.omega0 * linear(state))
        return self.last(state)


class PlainNaisr(nn.Module):
    """The networks T and f_1 ... f_N of a :class:`Naisr`, with its weights copied.

    Every argument has one row a point: ``points [n, dim]``, ``covariates [n, N]``, ``latents [n, L]``.
    """

    def __init__(self, network: Naisr) -> None:
        super().__init__()
        config, stack = network.config, network.displacement_networks
        dim = config.dim
        inputs = dim + 1 + config.latent
        self.template = PlainSiren(config.template, dim, 1)
        plains = [PlainSiren(config.displacement, inputs, dim, skipped=dim + 1) for _ in stack.last_bias]
        self.displacements = nn.ModuleList(plains)
        self.to(network.device, stack.last_bias.dtype)
        _copy(network.template_network, 0, self.template)
        for index, plain in enumerate(plains):
            _copy(stack, index, plain)

    def forward(self, points: Tensor, covariates: Tensor, latents: Tensor) -> Tensor:
        """Phi(p, c, z) = T(p + sum_i (f_i(p, c_i, z) - f_i(p, 0, z))), ``[n]``."""
        displaced = points
        for index, f in enumerate(self.displacements):
            value = covariates[:, index : index + 1]
            at_value = f(torch.cat([points, value, latents], dim=1))
            at_zero = f(torch.cat([points, torch.zeros_like(value), latents], dim=1))
            displaced = displaced + at_value - at_zero
        return self.template(displaced)[:, 0]


def plain_loss(
    network: PlainNaisr, batch: Batch, covariates: Tensor, latents: Tensor, weights: LossWeights
) -> Tensor:
    """L_on + L_off + L_lat with the paper's terms, all points of all shapes in one graph.

    Args:
        network: the plain networks.
        batch: of some shapes.
        covariates: ``[shapes, N]``.
        latents: ``[shapes, L]``.
        weights: those of the paper, lambda_1 ... lambda_6, are used.
    """
    points = torch.cat([batch.surface_points, batch.space_points], dim=1)
    shapes, count, dim = points.shape
    points = points.reshape(-1, dim).requires_grad_()
    values = network(
        points, covariates.repeat_interleave(count, dim=0), latents.repeat_interleave(count, dim=0)
    )
    slope = torch.autograd.grad(values.sum(), points, create_graph=True)[0].reshape(shapes, count, dim)
    values, on = values.reshape(shapes, count), batch.surface_points.shape[1]
    eikonal = (slope.norm(dim=-1) - 1).abs()
    cosine = nn.functional.cosine_similarity(slope[:, :on], batch.surface_normals, dim=-1)
    return (
        weights.surface_eikonal * eikonal[:, :on].mean()
        + weights.surface_distance * values[:, :on].abs().mean()
        + weights.surface_normal * (1 - cosine).mean()
        + weights.space_distance * (values[:, on:] - batch.space_sdf).abs().mean()
        + weights.space_eikonal * eikonal[:, on:].mean()
        + weights.latent * latents.square().mean() / weights.latent_sigma**2
    )


@torch.no_grad()
def _copy(source: SirenStack, index: int, target: PlainSiren) -> None:
    """The weights of one network of a stack, in the layout of ``target``."""
    first = torch.cat([source.point_weight[index], source.condition_weight[index]], dim=1)
    target.first.weight.copy_(first)
    target.first.bias.copy_(source.first_bias[index])
    for layer, linear in enumerate(target.hidden):
        parts = [source.hidden_weight[layer, index]]
        if layer == target.middle and target.skipped:
            parts += [source.skip_point_weight[index], source.skip_condition_weight[index]]
        assert isinstance(linear, nn.Linear)
        linear.weight.copy_(torch.cat(parts, dim=1))
        linear.bias.copy_(source.hidden_bias[layer, index])
    target.last.weight.copy_(source.last_weight[index])
    target.last.bias.copy_(source.last_bias[index])
