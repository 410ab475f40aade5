"""One iteration: which shapes and points, at which rates, and the gradients of their loss."""

from __future__ import annotations

import math

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from naisr_model.config import LossWeights, TrainingConfig
from naisr_model.learning.training.objective import Batch, latent_term, population_terms, reconstruction_terms
from naisr_model.learning.training.residual import residual_latents
from naisr_model.learning.training.task import State, Task
from naisr_model.models.base import ShapeModel

CACHED_POINTS = 1024
"""Points whose activations stay in a processor's cache together, twice as fast as many more."""

HELD_POINTS = 16_384
"""Points that keep a graphics card busy, with some GB of activations at the paper's size."""

POPULATION_SHAPES = 4
"""Shapes of a batch at whose points the effects are held in place."""


def accumulate_gradients(state: State, task: Task) -> dict[str, float]:
    """Forward and backward through the batch of this iteration; the weighted terms and their total."""
    config, chosen = task.config, _chosen(task, state.iteration)
    _set_rates(state, config, state.share(task))
    for optimiser in state.optimisers:
        optimiser.zero_grad()
    batch, covariates = _draw(task, chosen, state.iteration), task.covariates[chosen]
    codes = residual_latents(state.codes, task.basis)[chosen]
    if state.share(task) < config.population_share:
        codes = codes * 0
    # The codes' gradient is gathered over the parts of the batch and sent through the projection once.
    leaf = codes.detach().requires_grad_()
    sums = accumulate_reconstruction(state.model, batch, covariates, leaf, config.loss)
    _accumulate(latent_term(leaf, config.loss), 1.0, sums)
    few = slice(0, POPULATION_SHAPES)
    held = population_terms(state.model, batch.space_points[few], covariates[few], task.binary, config.loss)
    _accumulate(held, 1.0, sums)
    assert leaf.grad is not None
    codes.backward(leaf.grad)
    return sums | {"total": sum(sums.values())}


def accumulate_reconstruction(
    model: ShapeModel, batch: Batch, covariates: Tensor, latents: Tensor, weights: LossWeights
) -> dict[str, float]:
    """Add the gradients of L_on and L_off to the parameters, a part of the batch at a time.

    Args:
        model: is trained.
        batch: samples of some shapes.
        covariates: of those shapes, centred, ``[shapes, N]``.
        latents: their codes, ``[shapes, L]``.
        weights: of the terms.

    Returns:
        The weighted terms, means over the batch.
    """
    shapes, count = batch.surface_points.shape[0], batch.surface_points.shape[1] + batch.space_sdf.shape[1]
    sums: dict[str, float] = {}
    at_once = CACHED_POINTS if latents.device.type == "cpu" else HELD_POINTS
    shapes_at_once = max(1, at_once // count)
    for start in range(0, shapes, shapes_at_once):
        part = slice(start, min(start + shapes_at_once, shapes))
        terms = reconstruction_terms(model, batch.narrow(part), covariates[part], latents[part], weights)
        _accumulate(terms, (part.stop - part.start) / shapes, sums)
    return sums


def _accumulate(terms: dict[str, Tensor], share: float, sums: dict[str, float]) -> None:
    if not terms:
        return
    (share * torch.stack(list(terms.values())).sum()).backward()
    for name, term in terms.items():
        sums[name] = sums.get(name, 0.0) + share * float(term.detach())


def _chosen(task: Task, iteration: int) -> NDArray[np.intp]:
    """Training shapes of one batch; every epoch is a fresh permutation."""
    epoch, index = divmod(iteration, task.epoch_iterations)
    order = np.random.default_rng([task.config.seed, 0, epoch]).permutation(len(task.rows))
    return order[index * task.config.batch_shapes : (index + 1) * task.config.batch_shapes]


def _draw(task: Task, chosen: NDArray[np.intp], iteration: int) -> Batch:
    config = task.config
    counts = config.surface_points, config.near_points, config.uniform_points
    rng = np.random.default_rng([config.seed, 1, iteration])
    arrays = task.store.draw(task.rows[chosen].tolist(), *counts, rng)
    return Batch.from_arrays(*arrays, device=task.covariates.device)


def _set_rates(state: State, config: TrainingConfig, share: float) -> None:
    factor = 0.5 * (1 + math.cos(math.pi * share)) if config.cosine else 1.0
    for optimiser in state.optimisers:
        for group in optimiser.param_groups:
            group["lr"] = getattr(config, group["setting"]) * group["part"] * factor
