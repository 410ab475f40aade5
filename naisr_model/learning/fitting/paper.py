"""The paper's procedure of fitting codes (section "Testing"): the reference for the fast one.

It minimises the loss of the training with the networks fixed and the covariates known.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from naisr_model.config import FitConfig, LossWeights
from naisr_model.learning.training.objective import Batch, latent_term, reconstruction_terms
from naisr_model.models.base import ShapeModel
from naisr_model.progress import SILENT, Progress

BatchSource = Callable[[np.random.Generator], Batch]
"""Fresh samples of all shapes that are fitted together."""


def fit_latents(
    model: ShapeModel,
    draw: BatchSource,
    covariates: Tensor,
    config: FitConfig,
    weights: LossWeights,
    *,
    progress: Progress = SILENT,
) -> Tensor:
    """The codes z that minimise the training loss at known covariates, by Adam from z = 0.

    Shapes are independent of each other; fitting many at once only shares the matrix products.

    Args:
        model: trained, not changed.
        draw: gives the samples of one step.
        covariates: centred, ``[shapes, N]``.
        config: steps, rate and seed.
        weights: of the loss terms.
        progress: told the finished share after every step, checked before each.

    Returns:
        ``[shapes, L]``.

    Raises:
        Cancelled: when nobody waits for it any more.
    """
    latents = covariates.new_zeros(len(covariates), model.config.latent).requires_grad_()
    optimiser = torch.optim.Adam([latents], lr=config.rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, config.steps)
    frozen = [parameter for parameter in model.parameters() if parameter.requires_grad]
    for parameter in frozen:
        parameter.requires_grad_(False)
    try:
        for step, _ in progress.over(range(config.steps)):
            batch = draw(np.random.default_rng([config.seed, step]))
            optimiser.zero_grad()
            # Means over the shapes; multiplying by their number makes each fit its own problem.
            terms = reconstruction_terms(model, batch, covariates, latents, weights)
            terms |= latent_term(latents, weights)
            (len(latents) * torch.stack(list(terms.values())).sum()).backward()
            optimiser.step()
            schedule.step()
    finally:
        for parameter in frozen:
            parameter.requires_grad_(True)
    return latents.detach()
