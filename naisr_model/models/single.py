"""One network for everything: Phi(p, c, z) = f(p, k), k being what tells a shape apart.

There is no template. As in the comparisons of Jiao et al. (ICLR 2024) the layers are sines, so that the loss
may hold gradients; the conditions k enter the first layer and are not fed in again halfway.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar, final

import torch
from torch import Tensor, nn

from naisr_model.config import LossWeights, NetworkConfig, Preset, SirenConfig, TrainingConfig
from naisr_model.models.base import Linearised, PointFunction, ShapeModel
from naisr_model.models.siren import SirenStack


@dataclass(frozen=True)
class SingleConfig(NetworkConfig):
    """Sizes of the network; 512 wide and 8 layers deep in the papers.

    Attributes:
        shape: the network f.
    """

    shape: SirenConfig = field(default_factory=lambda: SirenConfig(width=512, hidden=6))


class SingleNetwork(ShapeModel, ABC):
    """The network f; what conditions it is for each model to say.

    Args:
        config: sizes of the network.
        conditions: how many numbers tell a shape apart.
    """

    settings: ClassVar[type[NetworkConfig]] = SingleConfig
    config: SingleConfig

    def __init__(self, config: SingleConfig, conditions: int) -> None:
        super().__init__()
        self.config = config
        self.network = SirenStack(config.shape, stack=1, dim=config.dim, outputs=1, conditions=conditions)

    @abstractmethod
    def conditions(self, covariates: Tensor, latents: Tensor) -> Tensor:
        """The numbers k, ``[shapes, K]``."""

    @final  # type: ignore[misc] # to torch it is an attribute that may be set
    def forward(self, points: Tensor, covariates: Tensor, latents: Tensor) -> Tensor:
        """Phi, ``[shapes, n]``."""
        distance: Tensor = self.network(points, self.conditions(covariates, latents)[None])
        return distance[0, :, :, 0]

    @final
    def linearised(self, points: Tensor, covariates: Tensor, latents: Tensor) -> Linearised:
        """Phi and grad Phi."""
        values, slopes = self.network.traced(points, self.conditions(covariates, latents)[None])
        slope = self.network.pulled_back(torch.ones_like(values), slopes)[0]
        return Linearised(values[0, :, :, 0], slope)

    @final
    def shape_function(self, covariates: Tensor, latent: Tensor) -> PointFunction:
        """Phi of one shape, ``[n]``; the conditions are one bias for all of its points."""
        given = covariates.to(self.device)[None], latent.to(self.device)[None]

        @torch.inference_mode()
        def shape(points: Tensor) -> Tensor:
            return self(points[None], *given)[0]

        return shape

    @final
    def rated_parameters(self) -> dict[str, list[nn.Parameter]]:
        """All of the one network."""
        return {"template_rate": list(self.parameters())}


def presets(model: str, prior: float) -> dict[str, Preset]:
    """The training at the papers' size, and one for two CPU cores, as the demo of NAISR.

    That one has low frequencies and many points far from the surface. Nothing shrinks a template here, so the
    paper's own terms do.

    Args:
        model: its name.
        prior: weight of the prior on the codes, in the demo.
    """
    training = TrainingConfig(
        epochs=100,
        batch_shapes=16,
        surface_points=64,
        near_points=32,
        uniform_points=32,
        template_rate=5e-4,
        latent_rate=3e-3,
        hidden_rate=0.02,
        cosine=True,
        loss=LossWeights(latent=prior),
    )
    small = SingleConfig(latent=64, shape=SirenConfig(width=192, hidden=3, omega0=10.0))
    return {
        f"{model}-paper": Preset(model, SingleConfig(), TrainingConfig()),
        f"{model}-demo": Preset(model, small, training),
    }
