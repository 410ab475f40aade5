"""DeepSDF (Park et al., CVPR 2019): one network of the point and the code, Phi(p, z) = f(p, z).

Nothing is known of covariates, so the code carries everything that sets a shape apart.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, final

from torch import Tensor

from naisr_model.capabilities import Capabilities
from naisr_model.config import Preset
from naisr_model.models.single import SingleConfig, SingleNetwork, presets


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

PRESETS: Mapping[str, Preset] = presets("deepsdf", prior=0.01)  # the code has everything to say
