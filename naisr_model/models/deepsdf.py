"""DeepSDF (Park et al., CVPR 2019): one network of the point and the code, Phi(p, z) = f(p, z).

There is no template and nothing is known of covariates, so the code carries everything that sets a shape
apart. As in the comparisons of Jiao et al. (ICLR 2024) the layers are sines, so that the loss may hold
gradients; the code enters the first layer and is not fed in again halfway.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, final

import torch
from torch import Tensor, nn

from naisr_model.capabilities import Capabilities
from naisr_model.config import LossWeights, NetworkConfig, Preset, SirenConfig, TrainingConfig
from naisr_model.models.base import Linearised, PointFunction, ShapeModel
from naisr_model.models.siren import SirenStack


@dataclass(frozen=True)
class DeepSdfConfig(NetworkConfig):
    """Sizes of the network; 512 wide and 8 layers deep in the paper.

    Attributes:
        shape: the network f.
    """

    shape: SirenConfig = field(default_factory=lambda: SirenConfig(width=512, hidden=6))


@final
class DeepSdf(ShapeModel):
    """The network f; covariates are taken and left unused."""

    title: ClassVar[str] = "DeepSDF"
    capabilities: ClassVar[Capabilities] = Capabilities()
    settings: ClassVar[type[NetworkConfig]] = DeepSdfConfig
    config: DeepSdfConfig

    def __init__(self, config: DeepSdfConfig, covariates: int) -> None:
        super().__init__()
        self.config = config
        self.network = SirenStack(config.shape, stack=1, dim=config.dim, outputs=1, conditions=config.latent)

    def forward(self, points: Tensor, covariates: Tensor, latents: Tensor) -> Tensor:
        """Phi, ``[shapes, n]``."""
        distance: Tensor = self.network(points, latents[None])
        return distance[0, :, :, 0]

    def linearised(self, points: Tensor, covariates: Tensor, latents: Tensor) -> Linearised:
        """Phi and grad Phi."""
        values, slopes = self.network.traced(points, latents[None])
        slope = self.network.pulled_back(torch.ones_like(values), slopes)[0]
        return Linearised(values[0, :, :, 0], slope, None)

    def shape_function(self, covariates: Tensor, latent: Tensor) -> PointFunction:
        """Phi of one shape, ``[n]``; the code is one bias for all of its points."""
        code = latent.to(self.device)[None]

        @torch.inference_mode()
        def shape(points: Tensor) -> Tensor:
            return self(points[None], covariates[None], code)[0]

        return shape

    def rated_parameters(self) -> dict[str, list[nn.Parameter]]:
        """All of the one network."""
        return {"template_rate": list(self.parameters())}


MODEL = DeepSdf

PRESETS: Mapping[str, Preset] = {
    "deepsdf-paper": Preset("deepsdf", DeepSdfConfig(), TrainingConfig()),
    # As the demo of NAISR: low frequencies and many points far from the surface. Nothing shrinks a template
    # here, so the paper's own terms do; the prior is weak because the code has everything to say.
    "deepsdf-demo": Preset(
        "deepsdf",
        DeepSdfConfig(latent=64, shape=SirenConfig(width=192, hidden=3, omega0=10.0)),
        TrainingConfig(
            epochs=300,
            batch_shapes=16,
            surface_points=64,
            near_points=32,
            uniform_points=32,
            template_rate=5e-4,
            latent_rate=3e-3,
            cosine=True,
            loss=LossWeights(latent=0.01),
        ),
    ),
}
