"""NAISR with one displacement of all covariates in the place of a sum: what the sum is worth.

    Phi(p, c, z) = T(p + f(p, c, z) - f(p, 0, z))

As in NAISR the shape at the population centre is the template, whatever the code is. But no covariate has a
displacement of its own, and what one does may depend on the others.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar, final

import torch
from torch import Tensor, nn

from naisr_model.capabilities import Capabilities
from naisr_model.config import NetworkConfig, Preset
from naisr_model.models import naisr
from naisr_model.models.base import DeformableModel, Linearised, PointFunction
from naisr_model.models.naisr import calculus
from naisr_model.models.naisr.network import NaisrConfig
from naisr_model.models.siren import SirenStack


@final
class Joint(DeformableModel):
    """The networks T and f."""

    title: ClassVar[str] = "NAISR, joint"
    capabilities: ClassVar[Capabilities] = Capabilities(
        deformable=True, evolvable=True, transferable=True, has_template=True, vanishes_at_centre=True
    )
    settings: ClassVar[type[NetworkConfig]] = NaisrConfig
    config: NaisrConfig

    def __init__(self, config: NaisrConfig, covariates: int) -> None:
        super().__init__()
        self.config = config
        self.template_network = SirenStack(config.template, stack=1, dim=config.dim, outputs=1)
        self.displacement_network = SirenStack(
            config.displacement,
            stack=1,
            dim=config.dim,
            outputs=config.dim,
            conditions=covariates + config.latent,
            skipped=covariates,
            output_scale=0.01,  # the template is found undeformed before it is deformed
        )

    def template(self, points: Tensor) -> Tensor:
        """T, the template's signed distance, ``[shapes, n]``."""
        distance: Tensor = self.template_network(points)
        return distance[0, :, :, 0]

    def displacement(self, points: Tensor, covariates: Tensor, latents: Tensor) -> Tensor:
        """f(p, c, z) - f(p, 0, z), ``[shapes, n, dim]``; 0 to rounding where c = 0."""
        both = self.displacement_network(points.repeat(2, 1, 1), _conditions(covariates, latents))
        value, zero = both[0].chunk(2, dim=0)
        return value - zero

    def linearised(self, points: Tensor, covariates: Tensor, latents: Tensor) -> Linearised:
        """Phi, grad Phi and grad T."""
        conditions = _conditions(covariates, latents)
        return calculus.linearised(self.template_network, self.displacement_network, points, conditions)

    def shape_function(self, covariates: Tensor, latent: Tensor) -> PointFunction:
        """Phi of one shape, ``[n]``; at the centre the template's networks alone."""
        given = covariates.to(self.device)[None], latent.to(self.device)[None]
        is_template = not bool(covariates.any())

        @torch.inference_mode()
        def shape(points: Tensor) -> Tensor:
            return (self.template(points[None]) if is_template else self(points[None], *given))[0]

        return shape

    def rated_parameters(self) -> dict[str, list[nn.Parameter]]:
        """T and f."""
        return {
            "template_rate": list(self.template_network.parameters()),
            "displacement_rate": list(self.displacement_network.parameters()),
        }


def _conditions(covariates: Tensor, latents: Tensor) -> Tensor:
    """What f sees beside the points: (c, z) of every shape, then (0, z), ``[1, 2 * shapes, N + L]``."""
    at_value = torch.cat([covariates, latents], dim=-1)
    at_zero = torch.cat([torch.zeros_like(covariates), latents], dim=-1)
    return torch.cat([at_value, at_zero])[None]


def _alike(preset: Preset) -> Preset:
    """A preset of NAISR without the terms that only a sum has."""
    training = preset.training
    loss = replace(training.loss, centring=0.0, ridge=0.0)
    return replace(preset, model="joint", training=replace(training, population_share=0.0, loss=loss))


MODEL = Joint

PRESETS: Mapping[str, Preset] = {
    "joint-paper": _alike(naisr.PRESETS["paper-airway"]),
    "joint-demo": _alike(naisr.PRESETS["demo"]),
}
