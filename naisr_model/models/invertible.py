"""NAISR whose covariates add up velocities in the place of displacements, so that nothing can fold.

    u(p, c, z) = sum_i u_i(p, c_i, z),    u_i(p, c_i, z) = f_i(p, c_i, z) - f_i(p, 0, z)
    Phi(p, c, z) = T(q),   where q is where p has come to after it went with u for one unit of time

As in NAISR each covariate has a shape of its own, the one where all others are at 0, and at the centre every
shape is the template. The displacements of the covariates do not add up, though: their velocities do.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

import torch
from torch import Tensor

from naisr_model.capabilities import Capabilities
from naisr_model.config import NetworkConfig, Preset, Range
from naisr_model.models import naisr
from naisr_model.models.base import DisentangledModel
from naisr_model.models.flow import flowed
from naisr_model.models.naisr import calculus
from naisr_model.models.naisr.network import NaisrConfig
from naisr_model.models.siren import SirenStack
from naisr_model.models.warping import WarpingModel


@dataclass(frozen=True)
class InvertibleConfig(NaisrConfig):
    """Sizes of the networks, ``displacement`` being that of every f_i.

    Attributes:
        steps: in which the velocity is followed.
    """

    steps: Annotated[int, Range(1, 64)] = 2


@final
class Invertible(WarpingModel, DisentangledModel):
    """The networks T and f_1 ... f_N."""

    title: ClassVar[str] = "NAISR, invertible"
    capabilities: ClassVar[Capabilities] = Capabilities(
        deformable=True,
        disentangleable=True,
        evolvable=True,
        transferable=True,
        invertible=True,
        has_template=True,
        vanishes_at_centre=True,
    )
    settings: ClassVar[type[NetworkConfig]] = InvertibleConfig
    config: InvertibleConfig

    def __init__(self, config: InvertibleConfig, covariates: int) -> None:
        super().__init__(config, config.template)
        self.velocity_networks = SirenStack(
            config.displacement,
            stack=covariates,
            dim=config.dim,
            outputs=config.dim,
            conditions=1 + config.latent,
            skipped=1,
            output_scale=0.01,  # the template is found undeformed before it is deformed
        )

    def displacement(self, points: Tensor, covariates: Tensor, latents: Tensor) -> Tensor:
        """The whole way q - p, ``[shapes, n, dim]``; 0 where c = 0."""
        conditions = calculus.conditions(covariates, latents)

        def velocity(here: Tensor) -> Tensor:
            both = self.velocity_networks(here.repeat(2, 1, 1), conditions).sum(dim=0)
            at_value, at_zero = both.chunk(2)
            return at_value - at_zero

        return flowed(velocity, points, self.config.steps) - points

    def displacements(self, points: Tensor, covariates: Tensor, latents: Tensor) -> Tensor:
        """The way of each covariate alone, ``[N, shapes, n, dim]``; 0 where c_i = 0."""
        count, shapes = covariates.shape[1], len(points)
        alone = torch.diag_embed(covariates).transpose(0, 1).flatten(0, 1)
        every = self.displacement(points.repeat(count, 1, 1), alone, latents.repeat(count, 1))
        return every.view(count, shapes, *points.shape[1:])


def _alike(preset: Preset) -> Preset:
    sizes = preset.network
    assert isinstance(sizes, NaisrConfig)
    return replace(
        preset,
        model="invertible",
        network=InvertibleConfig(sizes.dim, sizes.latent, sizes.template, sizes.displacement),
    )


MODEL = Invertible

PRESETS: Mapping[str, Preset] = {
    "invertible-paper": _alike(naisr.PRESETS["paper-airway"]),
    "invertible-demo": _alike(naisr.PRESETS["demo"]),
}
