"""Training: a step of the fast implementation against the paper's equations written down plainly."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from naisr_model.benchmark.figures import Figure, Figures
from naisr_model.benchmark.plain import PlainNaisr, plain_loss
from naisr_model.benchmark.subject import Scope, Subject
from naisr_model.benchmark.timing import timed
from naisr_model.config import Preset
from naisr_model.learning.training.objective import Batch, latent_term
from naisr_model.learning.training.step import accumulate_reconstruction
from naisr_model.models.factory import build, preset
from naisr_model.models.naisr.network import Naisr


def figures(scope: Scope) -> tuple[Figure, ...]:
    """What is measured, in the order of the table."""
    return (
        Figure(
            "train_speedup",
            "",
            f"training step (forward, losses, backward, Adam) of {scope.shapes} shapes of "
            f"{preset(scope.training).training.shape_points} points: points per second over those of a plain "
            f"implementation of the paper's equations, alternating",
            at_least=2.0,
        ),
        Figure("train_points_per_s", "points/s", "points per second of that step"),
    )


def measure(subject: Subject) -> Figures:
    """Steps of the fast and of the plain implementation in turn, from the same weights."""
    scope, device = subject.scope, subject.atlas.device
    sizes = preset(scope.training)
    with torch.random.fork_rng():
        torch.manual_seed(0)
        network = build(sizes, covariates=3).to(device)
        batch = Batch(*(part.to(device) for part in _random_batch(sizes, scope.shapes)))
        covariates = torch.randn(scope.shapes, 3).to(device)
        codes = 0.01 * torch.randn(scope.shapes, sizes.network.latent).to(device)
    assert isinstance(network, Naisr)
    plain = PlainNaisr(network)
    weights = preset("paper-airway").training.loss

    def fast_loss(latents: Tensor) -> None:
        accumulate_reconstruction(network, batch, covariates, latents, weights)
        latent_term(latents, weights)["latent"].backward()

    def slow_loss(latents: Tensor) -> None:
        plain_loss(plain, batch, covariates, latents, weights).backward()

    steps = _step(network, codes, fast_loss), _step(plain, codes, slow_loss)
    times = []
    for _ in range(scope.repeats + 1):  # the first one warms up
        subject.progress.check()
        times.append([timed(step) for step in steps])
    fast, slow = np.median(times[1:], axis=0)
    points = scope.shapes * sizes.training.shape_points
    return {"train_speedup": float(slow / fast), "train_points_per_s": float(points / fast)}


def _random_batch(sizes: Preset, shapes: int) -> Batch:
    """Points and normals anywhere: a step takes as long as with real ones."""
    training, dim = sizes.training, sizes.network.dim
    on, off = training.surface_points, training.near_points + training.uniform_points
    normals = torch.nn.functional.normalize(torch.randn(shapes, on, dim), dim=-1)
    surface, space = (2 * torch.rand(shapes, count, dim) - 1 for count in (on, off))
    return Batch(surface, normals, space, torch.rand(shapes, off) - 0.5)


def _step(network: torch.nn.Module, codes: Tensor, backward: Callable[[Tensor], None]) -> Callable[[], None]:
    """One training step of Adam on the weights and on a copy of the codes."""
    latents = codes.clone().requires_grad_()
    optimiser = torch.optim.Adam([*network.parameters(), latents], lr=5e-5)

    def step() -> None:
        optimiser.zero_grad()
        backward(latents)
        optimiser.step()

    return step
