"""NAISR: a template deformed by a sum of displacement fields, one per covariate.

Equations of section "Model Formulation" of Jiao et al. (ICLR 2024), in model units:

    g_i(p, c_i, z) = f_i(p, c_i, z) - f_i(p, 0, z)
    Phi(p, c, z)   = T(p + sum_i g_i(p, c_i, z))
    Phi_i(p, c_i, z) = T(p + g_i(p, c_i, z))

The fields live at points of the *target* shape and point to the template.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, final

import torch
from torch import Tensor, nn

from naisr_model.capabilities import Capabilities
from naisr_model.config import NetworkConfig, SirenConfig
from naisr_model.models.base import AdditiveModel, Linearised, PointFunction
from naisr_model.models.naisr import calculus, inference
from naisr_model.models.siren import SirenStack


@dataclass(frozen=True)
class NaisrConfig(NetworkConfig):
    """Sizes of the template network T and of the displacement networks f_i.

    Attributes:
        template: the network T.
        displacement: every network f_i.
    """

    template: SirenConfig = field(default_factory=SirenConfig)
    displacement: SirenConfig = field(default_factory=SirenConfig)


@final
class Naisr(AdditiveModel):
    """The networks T and f_1 ... f_N."""

    title: ClassVar[str] = "NAISR"
    capabilities: ClassVar[Capabilities] = Capabilities(
        deformable=True,
        disentangleable=True,
        additive=True,
        evolvable=True,
        transferable=True,
        has_template=True,
        vanishes_at_centre=True,
    )
    settings: ClassVar[type[NetworkConfig]] = NaisrConfig
    config: NaisrConfig

    def __init__(self, config: NaisrConfig, covariates: int) -> None:
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

    def template(self, points: Tensor) -> Tensor:
        """T, the template's signed distance, ``[shapes, n]``."""
        distance: Tensor = self.template_network(points)
        return distance[0, :, :, 0]

    def displacements(self, points: Tensor, covariates: Tensor, latents: Tensor) -> Tensor:
        """All g_i, ``[N, shapes, n, dim]``; 0 to rounding where c_i = 0."""
        both = self.displacement_networks(points.repeat(2, 1, 1), calculus.conditions(covariates, latents))
        value, zero = both.chunk(2, dim=1)
        return value - zero

    def linearised(self, points: Tensor, covariates: Tensor, latents: Tensor) -> Linearised:
        """Phi, grad Phi and grad T."""
        conditions = calculus.conditions(covariates, latents)
        return calculus.linearised(self.template_network, self.displacement_networks, points, conditions)

    def shape_function(self, covariates: Tensor, latent: Tensor) -> PointFunction:
        """Phi of one shape, ``[n]``; networks of covariates at 0 are left out."""
        displacement = inference.displacement_function(self.displacement_networks, covariates, latent)

        @torch.inference_mode()
        def shape(points: Tensor) -> Tensor:
            return self.template((points + displacement(points))[None])[0]

        return shape

    def effect_function(self, index: int, values: Tensor, latent: Tensor) -> PointFunction:
        """g_i at several values of c_i, ``[K, n, dim]``."""
        return inference.effect_function(self.displacement_networks, index, values, latent)

    def rated_parameters(self) -> dict[str, list[nn.Parameter]]:
        """T and the f_i."""
        return {
            "template_rate": list(self.template_network.parameters()),
            "displacement_rate": list(self.displacement_networks.parameters()),
        }
