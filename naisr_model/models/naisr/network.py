"""NAISR: a template deformed by a sum of displacement fields, one per covariate.

Equations of section "Model Formulation" of Jiao et al. (ICLR 2024), in model units:

    g_i(p, c_i, z) = f_i(p, c_i, z) - f_i(p, 0, z)
    Phi(p, c, z)   = T(p + sum_i g_i(p, c_i, z))
    Phi_i(p, c_i, z) = T(p + g_i(p, c_i, z))

The fields live at points of the *target* shape and point to the template.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor, nn

from naisr_model.config import NetworkConfig
from naisr_model.models.siren import SirenStack


class Naisr(nn.Module):
    """The networks T and f_1 ... f_N.

    Shapes of all arguments: ``points [shapes, n, dim]`` in model units, ``covariates [shapes, N]``
    centred (0 is the population centre), ``latents [shapes, L]`` (0 is the population average).
    """

    def __init__(self, config: NetworkConfig, covariates: int) -> None:
        super().__init__()
        self.config = config
        self.template_network = SirenStack(config.template, stack=1, dim=config.dim, outputs=1)
        self.displacement_networks = SirenStack(
            config.displacement,
            stack=covariates,
            dim=config.dim,
            outputs=config.dim,
            conditions=1 + config.latent,
            skipped=1,
            output_scale=0.01,  # the template is found undeformed before it is deformed
        )

    @property
    def device(self) -> torch.device:
        """Where the weights are."""
        return self.template_network.last_bias.device

    def tensor(self, values: ArrayLike) -> Tensor:
        """``values`` as the networks take them: in single precision, where the weights are."""
        return torch.as_tensor(np.asarray(values, dtype=np.float32)).to(self.device)

    def template(self, points: Tensor) -> Tensor:
        """T, the template's signed distance, ``[shapes, n]``."""
        distance: Tensor = self.template_network(points)
        return distance[0, :, :, 0]

    def displacements(self, points: Tensor, covariates: Tensor, latents: Tensor) -> Tensor:
        """All g_i, ``[N, shapes, n, dim]``; 0 to rounding where c_i = 0."""
        both = self.displacement_networks(points.repeat(2, 1, 1), self.conditions(covariates, latents))
        value, zero = both.chunk(2, dim=1)
        return value - zero

    @staticmethod
    def conditions(covariates: Tensor, latents: Tensor) -> Tensor:
        """What the f_i see beside the points: (c_i, z) of every shape, then (0, z).

        Returns:
            ``[N, 2 * shapes, 1 + L]``.
        """
        codes = latents.expand(covariates.shape[1], *latents.shape)
        at_value = torch.cat([covariates.T[..., None], codes], dim=-1)
        at_zero = torch.cat([torch.zeros_like(covariates).T[..., None], codes], dim=-1)
        return torch.cat([at_value, at_zero], dim=1)

    def forward(self, points: Tensor, covariates: Tensor, latents: Tensor) -> tuple[Tensor, Tensor]:
        """Phi and the whole displacement.

        Returns:
            The signed distance ``[shapes, n]`` and sum_i g_i ``[shapes, n, dim]``, both model units.
        """
        displacement = self.displacements(points, covariates, latents).sum(dim=0)
        return self.template(points + displacement), displacement
