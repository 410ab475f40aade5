"""NDF (Sun et al., CVPR 2022): a template met at points that flow, so that nothing can fold.

The flow is made of blocks, each with a velocity of its own that the code conditions and that does not change
in time:

    dp/dt = v_k(p, z) for t from k - 1 to k,    k = 1 ... K
    Phi(p, z) = T(p(K))

Nothing is known of covariates. As in the comparisons of Jiao et al. (ICLR 2024) the template's layers are
sines and the losses are NAISR's, beside the terms of NDF's own that keep displacements short and alike among
neighbours; here the velocities' layers are sines too, as smooth as NAISR's displacements.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, ClassVar, final

from torch import Tensor, nn

from naisr_model.capabilities import Capabilities
from naisr_model.config import LossWeights, NetworkConfig, Preset, Range, SirenConfig
from naisr_model.models import naisr
from naisr_model.models.base import PointFunction
from naisr_model.models.flow import flowed
from naisr_model.models.siren import SirenStack
from naisr_model.models.warping import WarpingModel


@dataclass(frozen=True)
class NdfConfig(NetworkConfig):
    """Sizes of the template network and of the velocities.

    Attributes:
        template: the network T.
        velocity: every network v_k.
        blocks: how many there are, K.
        steps: in which each is followed.
    """

    template: SirenConfig = field(default_factory=SirenConfig)
    velocity: SirenConfig = field(default_factory=lambda: SirenConfig(width=128, hidden=2, omega0=3.0))
    blocks: Annotated[int, Range(1, 64)] = 4
    steps: Annotated[int, Range(1, 64)] = 1


@final
class Ndf(WarpingModel):
    """The networks T and v_1 ... v_K; covariates are taken and left unused."""

    title: ClassVar[str] = "NDF"
    capabilities: ClassVar[Capabilities] = Capabilities(deformable=True, invertible=True, has_template=True)
    settings: ClassVar[type[NetworkConfig]] = NdfConfig
    config: NdfConfig

    def __init__(self, config: NdfConfig, covariates: int) -> None:
        super().__init__(config, config.template)
        self.velocities = nn.ModuleList(
            SirenStack(
                config.velocity,
                stack=1,
                dim=config.dim,
                outputs=config.dim,
                conditions=config.latent,
                output_scale=0.01,  # the template is found undeformed before it is deformed
            )
            for _ in range(config.blocks)
        )

    def displacement(self, points: Tensor, covariates: Tensor, latents: Tensor) -> Tensor:
        """p(K) - p(0), ``[shapes, n, dim]``."""
        here = points
        for block in self.velocities:
            here = flowed(_velocity(block, latents), here, self.config.steps)
        return here - points


def _velocity(block: nn.Module, latents: Tensor) -> PointFunction:
    def velocity(points: Tensor) -> Tensor:
        moved: Tensor = block(points, latents[None])
        return moved[0]

    return velocity


def _like(preset: Preset, config: NdfConfig, loss: LossWeights) -> Preset:
    """A training of NAISR's length and rates, with NDF's own terms."""
    own = replace(loss, pointwise=0.5, pointpair=0.01)
    training = replace(preset.training, population_share=0.0, residual_latents=False, loss=own)
    return Preset("ndf", config, training)


MODEL = Ndf

PRESETS: Mapping[str, Preset] = {
    "ndf-paper": _like(naisr.PRESETS["paper-airway"], NdfConfig(), LossWeights()),
    "ndf-demo": _like(
        naisr.PRESETS["demo"],
        NdfConfig(
            latent=64,
            template=SirenConfig(192, 3, omega0=10.0),
            velocity=SirenConfig(64, 2, omega0=3.0),
        ),
        replace(naisr.PRESETS["demo"].training.loss, centring=0.0, ridge=0.0),
    ),
}
