"""DIT (Zheng et al., CVPR 2021): a template met at points that a recurrent network moves step by step.

An LSTM that sees the code and where the point is says of each step how to scale and shift it:

    p_k = p_(k-1) + alpha_k p_(k-1) + beta_k,    (alpha_k, beta_k) = LSTM(p_(k-1), z),    k = 1 ... 8
    Phi(p, z) = T(p_8)

Nothing is known of covariates. As in the comparisons of Jiao et al. (ICLR 2024) the template's layers are
sines and the losses are NAISR's; DIT's own are kept beside them: the template has to say something at every
other step already, and displacements are kept short and alike among neighbours.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, ClassVar, final

import torch
from torch import Tensor, nn

from naisr_model.capabilities import Capabilities
from naisr_model.config import LossWeights, NetworkConfig, Preset, Range, SirenConfig
from naisr_model.models import naisr
from naisr_model.models.base import Linearised
from naisr_model.models.products import multiply
from naisr_model.models.warping import WarpingModel

STEPS = 8

JUDGED = (2, 4, 6)
"""Steps after which the template is asked, beside the last one."""


@dataclass(frozen=True)
class DitConfig(NetworkConfig):
    """Sizes of the template network and of the recurrent one.

    Attributes:
        template: the network T.
        warp_width: units of the LSTM.
    """

    template: SirenConfig = field(default_factory=lambda: SirenConfig(hidden=5))
    warp_width: Annotated[int, Range(1, 4096)] = 512


@final
class Dit(WarpingModel):
    """The network T and one LSTM cell; covariates are taken and left unused."""

    title: ClassVar[str] = "DIT"
    capabilities: ClassVar[Capabilities] = Capabilities(deformable=True, stepwise=True, has_template=True)
    settings: ClassVar[type[NetworkConfig]] = DitConfig
    config: DitConfig

    def __init__(self, config: DitConfig, covariates: int) -> None:
        super().__init__(config, config.template)
        width, bound = config.warp_width, 1 / math.sqrt(config.warp_width)
        self.point_weight = _uniform(bound, 4 * width, config.dim)
        self.code_weight = _uniform(bound, 4 * width, config.latent)
        self.state_weight = _uniform(bound, 4 * width, width)
        self.gate_bias = _uniform(bound, 4 * width)
        self.last_weight = _uniform(0.01 * bound, 2 * config.dim, width)  # the template is found undeformed

    def displacement(self, points: Tensor, covariates: Tensor, latents: Tensor) -> Tensor:
        """p_8 - p, ``[shapes, n, dim]``."""
        *_, last = self.steps(points, latents)
        return last - points

    def linearised(self, points: Tensor, covariates: Tensor, latents: Tensor) -> Linearised:
        """Phi, its slope, and what the template says underway."""
        located = points.detach().requires_grad_()
        places = list(self.steps(located, latents))
        underway = torch.stack([self.template(places[step - 1]) for step in JUDGED])
        return self.met(located, places[-1])._replace(underway=underway)

    def steps(self, points: Tensor, latents: Tensor) -> Iterator[Tensor]:
        """Where points are after each step, ``[shapes, n, dim]``.

        The equations of the cell are Hochreiter and Schmidhuber's (1997) with a forget gate; what it sees of
        the code is one bias a shape.
        """
        shapes, count, dim = points.shape
        of_code = (latents @ self.code_weight.mT + self.gate_bias)[:, None]
        state = cell = points.new_zeros(1, shapes * count, self.config.warp_width)
        for _ in range(STEPS):
            seen = multiply(points.reshape(1, -1, dim), self.point_weight.mT[None])
            gates = (seen + multiply(state, self.state_weight.mT[None])).view(shapes, count, -1) + of_code
            enter, forget, new, leave = gates.view(1, shapes * count, -1).chunk(4, dim=-1)
            cell = torch.sigmoid(forget) * cell + torch.sigmoid(enter) * torch.tanh(new)
            state = torch.sigmoid(leave) * torch.tanh(cell)
            scale, shift = multiply(state, self.last_weight.mT[None]).view(shapes, count, -1).chunk(2, dim=-1)
            points = points + scale * points + shift
            yield points


def _uniform(bound: float, *shape: int) -> nn.Parameter:
    return nn.Parameter(torch.empty(shape).uniform_(-bound, bound))


OWN = LossWeights(underway=100.0, pointwise=0.5, pointpair=0.01)
"""DIT's own terms, in the proportion to a distance's error that its authors gave them."""


def _like(preset: Preset, config: DitConfig, loss: LossWeights) -> Preset:
    """A training of NAISR's length and rates, with DIT's own terms."""
    own = replace(loss, underway=OWN.underway, pointwise=OWN.pointwise, pointpair=OWN.pointpair)
    training = replace(preset.training, population_share=0.0, residual_latents=False, loss=own)
    return Preset("dit", config, training)


MODEL = Dit

PRESETS: Mapping[str, Preset] = {
    "dit-paper": _like(naisr.PRESETS["paper-airway"], DitConfig(), LossWeights()),
    "dit-demo": _like(
        naisr.PRESETS["demo"],
        DitConfig(latent=64, template=SirenConfig(192, 3, omega0=10.0), warp_width=96),
        replace(naisr.PRESETS["demo"].training.loss, centring=0.0, ridge=0.0),
    ),
}
