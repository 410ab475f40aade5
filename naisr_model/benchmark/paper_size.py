"""A trained atlas of small networks as the same atlas at the paper's network size.

The fields stay what they are, so that what is measured on them is measured on real shapes; only the
work an evaluation takes becomes the paper's. A product with zeros takes as long as any other.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import torch

from naisr_model.atlas import Atlas
from naisr_model.errors import InputError
from naisr_model.models.naisr.network import Naisr, NaisrConfig
from naisr_model.models.siren import SirenStack

LINEAR = 1e-3
"""Layers that are to change nothing work at angles this small, where sin(x) = x to single precision."""


def paper_sized(atlas: Atlas) -> Atlas:
    """The same atlas with networks of the size of ``paper-airway``.

    Raises:
        InputError: when its networks are larger than that, or of another model.
    """
    checkpoint, own = atlas.checkpoint, atlas.checkpoint.model()
    if not isinstance(own, Naisr):
        raise InputError(f"the paper's network size is that of {Naisr.title}; give an atlas of it")
    network = at_paper_size(own)
    padding = network.config.latent - checkpoint.latents.shape[1]
    return Atlas(
        dataclasses.replace(
            checkpoint,
            preset=dataclasses.replace(checkpoint.preset, network=network.config),
            weights=network.state_dict(),
            latents=np.pad(checkpoint.latents, [(0, 0), (0, padding)]),
        ),
        atlas.device,
    )


def at_paper_size(network: Naisr) -> Naisr:
    """Networks of the size of ``paper-airway`` with the fields of ``network``.

    A code z becomes (z, 0).

    Raises:
        InputError: when ``network`` is larger than that.
    """
    config = NaisrConfig(dim=network.config.dim)
    if not _fits(network.config, config):
        raise InputError("the atlas has larger networks than the paper's; measure a smaller one")
    large = Naisr(config, len(network.displacement_networks.last_bias)).to(network.device)
    _embed(network.template_network, large.template_network)
    _embed(network.displacement_networks, large.displacement_networks)
    return large.eval()


def _fits(small: NaisrConfig, large: NaisrConfig) -> bool:
    return small.latent <= large.latent and all(
        mine.width <= theirs.width and mine.hidden <= theirs.hidden
        for mine, theirs in ((small.template, large.template), (small.displacement, large.displacement))
    )


@torch.no_grad()
def _embed(source: SirenStack, target: SirenStack) -> None:
    """Give ``target`` the function of ``source``: its weights in a corner, zeros about them.

    The layers that meet the skipped inputs again are laid on each other; layers that ``source`` lacks
    pass their input on, scaled by ``LINEAR``, which the next weight undoes.
    """
    for parameter in target.parameters():
        parameter.zero_()
    width, conditions = source.condition_weight.shape[1:]
    ratio, offset, scale = source.omega0 / target.omega0, target.middle - source.middle, 1.0
    target.point_weight[:, :width] = ratio * source.point_weight
    target.condition_weight[:, :width, :conditions] = ratio * source.condition_weight
    target.first_bias[:, :width] = ratio * source.first_bias
    for layer, weight in enumerate(target.hidden_weight):
        own = layer - offset
        if 0 <= own < len(source.hidden_weight):
            weight[:, :width, :width] = ratio / scale * source.hidden_weight[own]
            target.hidden_bias[layer, :, :width] = ratio * source.hidden_bias[own]
            scale = 1.0
        else:
            passed = LINEAR if scale == 1 else 1.0
            weight.diagonal(dim1=1, dim2=2)[:] = passed / target.omega0
            scale = LINEAR
    target.skip_point_weight[:, :width] = ratio * source.skip_point_weight
    target.skip_condition_weight[:, :width] = ratio * source.skip_condition_weight
    target.last_weight[:, :, :width] = source.last_weight / scale
    target.last_bias.copy_(source.last_bias)
