"""A template met at points that a network of any kind moves: what all such models share.

How the points are moved is for each model to say; the slope of the field follows by automatic
differentiation, where NAISR's own networks have the chain rule written out.
"""

from __future__ import annotations

from abc import ABC
from typing import final

import torch
from torch import Tensor

from naisr_model.config import NetworkConfig, SirenConfig
from naisr_model.models.base import DeformableModel, Linearised, PointFunction
from naisr_model.models.siren import SirenStack


class WarpingModel(DeformableModel, ABC):
    """The network T; a subclass has the networks that move points.

    Args:
        config: sizes of the networks.
        template: of T.
    """

    def __init__(self, config: NetworkConfig, template: SirenConfig) -> None:
        super().__init__()
        self.config = config
        self.template_network = SirenStack(template, stack=1, dim=config.dim, outputs=1)

    @final
    def template(self, points: Tensor) -> Tensor:
        """T, the template's signed distance, ``[shapes, n]``."""
        distance: Tensor = self.template_network(points)
        return distance[0, :, :, 0]

    def linearised(self, points: Tensor, covariates: Tensor, latents: Tensor) -> Linearised:
        """Phi, grad Phi = (I + grad d)^T grad T, and grad T."""
        located = points.detach().requires_grad_()
        return self.met(located, located + self.displacement(located, covariates, latents))

    @final
    def met(self, points: Tensor, moved: Tensor) -> Linearised:
        """What the template says at points that were moved.

        Args:
            points: ``[shapes, n, dim]`` with ``requires_grad``.
            moved: p + d(p), made of them.
        """
        values, slopes = self.template_network.traced(moved)
        template_slope = self.template_network.pulled_back(torch.ones_like(values), slopes)[0]
        (slope,) = torch.autograd.grad(moved, points, template_slope, create_graph=True)
        return Linearised(values[0, :, :, 0], slope, template_slope, moved - points)

    @final
    def shape_function(self, covariates: Tensor, latent: Tensor) -> PointFunction:
        """Phi of one shape, ``[n]``; where nothing can be displaced, the template's network alone."""
        given = covariates.to(self.device)[None], latent.to(self.device)[None]
        is_template = self.capabilities.vanishes_at_centre and not bool(covariates.any())

        @torch.inference_mode()
        def shape(points: Tensor) -> Tensor:
            return (self.template(points[None]) if is_template else self(points[None], *given))[0]

        return shape

    @final
    def rated_parameters(self) -> dict[str, list[torch.nn.Parameter]]:
        """T, and whatever moves points."""
        template = list(self.template_network.parameters())
        own = {id(parameter) for parameter in template}
        moving = [parameter for parameter in self.parameters() if id(parameter) not in own]
        return {"template_rate": template, "displacement_rate": moving}
