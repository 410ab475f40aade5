"""DeepSDF (Park et al., CVPR 2019): one network of the point and the code, Phi(p, z) = f(p, z).

Nothing is known of covariates, so the code carries everything that sets a shape apart.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, final

from torch import Tensor

from naisr_model.capabilities import Capabilities
from naisr_model.config import LossWeights, Preset, SirenConfig, TrainingConfig
from naisr_model.models.single import SingleConfig, SingleNetwork


@final
class DeepSdf(SingleNetwork):
    """The network of the code; covariates are taken and left unused."""

    title: ClassVar[str] = "DeepSDF"
    capabilities: ClassVar[Capabilities] = Capabilities()

    def __init__(self, config: SingleConfig, covariates: int) -> None:
        super().__init__(config, config.latent)

    def conditions(self, covariates: Tensor, latents: Tensor) -> Tensor:
        """The code."""
        return latents


MODEL = DeepSdf

PRESETS: Mapping[str, Preset] = {
    "deepsdf-paper": Preset("deepsdf", SingleConfig(), TrainingConfig()),
    # As the demo of NAISR: low frequencies and many points far from the surface. Nothing shrinks a template
    # here, so the paper's own terms do; the prior is weak because the code has everything to say.
    "deepsdf-demo": Preset(
        "deepsdf",
        SingleConfig(latent=64, shape=SirenConfig(width=192, hidden=3, omega0=10.0)),
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
