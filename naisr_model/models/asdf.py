"""A-SDF (Mu et al., ICCV 2021): one network of the point, covariates and code, Phi(p, c, z) = f(p, c, z).

The covariates are what the articulation is there. Nothing keeps the code from saying what a covariate says,
and no shape of one covariate alone is defined.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, final

import torch
from torch import Tensor

from naisr_model.capabilities import Capabilities
from naisr_model.config import Preset
from naisr_model.models.single import SingleConfig, SingleNetwork, presets


@final
class ASdf(SingleNetwork):
    """The network of covariates and code."""

    title: ClassVar[str] = "A-SDF"
    capabilities: ClassVar[Capabilities] = Capabilities(evolvable=True, transferable=True)

    def __init__(self, config: SingleConfig, covariates: int) -> None:
        super().__init__(config, covariates + config.latent)

    def conditions(self, covariates: Tensor, latents: Tensor) -> Tensor:
        """Covariates, then the code."""
        return torch.cat([covariates, latents], dim=1)


MODEL = ASdf

PRESETS: Mapping[str, Preset] = presets("asdf", prior=0.1)
