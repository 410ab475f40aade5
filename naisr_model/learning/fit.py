"""Fitting latent codes to given shapes with the networks fixed (section "Testing" of the paper)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from naisr_model.config import FitConfig, LossWeights
from naisr_model.errors import Cancelled
from naisr_model.learning.objective import Batch, latent_term, reconstruction_terms
from naisr_model.networks.naisr import Naisr

Draw = Callable[[np.random.Generator], Batch]
"""Fresh samples of all shapes that are fitted together."""


def fit_latents(
    network: Naisr,
    draw: Draw,
    covariates: Tensor,
    config: FitConfig,
    weights: LossWeights,
    *,
    progress: Callable[[float], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> Tensor:
    """The codes z that minimise the training loss at known covariates, by Adam from z = 0.

    Shapes are independent of each other; fitting many at once only shares the matrix products.

    Args:
        network: trained networks; they are not changed.
        draw: gives the samples of one step.
        covariates: centred, ``[shapes, N]``.
        config: steps, rate and seed.
        weights: of the loss terms.
        progress: told the finished share after every step.
        should_stop: polled before every step.

    Returns:
        ``[shapes, L]``.

    Raises:
        Cancelled: when ``should_stop()`` turned true.
    """
    latents = covariates.new_zeros(len(covariates), network.config.latent).requires_grad_()
    optimiser = torch.optim.Adam([latents], lr=config.rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, config.steps)
    frozen = [parameter for parameter in network.parameters() if parameter.requires_grad]
    for parameter in frozen:
        parameter.requires_grad_(False)
    try:
        for step in range(config.steps):
            if should_stop is not None and should_stop():
                raise Cancelled
            batch = draw(np.random.default_rng([config.seed, step]))
            optimiser.zero_grad()
            # Means over the shapes; multiplying by their number makes each fit its own problem.
            terms = reconstruction_terms(network, batch, covariates, latents, weights)
            terms |= latent_term(latents, weights)
            (len(latents) * torch.stack(list(terms.values())).sum()).backward()
            optimiser.step()
            schedule.step()
            if progress is not None:
                progress((step + 1) / config.steps)
    finally:
        for parameter in frozen:
            parameter.requires_grad_(True)
    return latents.detach()
