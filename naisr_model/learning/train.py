"""Training: one loop over random batches of shapes, resumable at any moment.

Every draw is a function of (seed, iteration), so a training that was killed and started again ends
with the same weights as one that was not.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from naisr_model import checkpoint as checkpoints
from naisr_model.checkpoint import Checkpoint
from naisr_model.config import Preset, TrainingConfig
from naisr_model.data.store import SampleStore
from naisr_model.errors import Cancelled, InputError
from naisr_model.files import replacing
from naisr_model.learning.objective import Batch, latent_term, population_terms, reconstruction_terms
from naisr_model.learning.residual import smooth_basis
from naisr_model.networks.naisr import Naisr
from naisr_model.surface.fields import folded, template_field
from naisr_model.surface.isosurface import isosurface
from naisr_model.surface.lattice import Lattice
from naisr_model.surface.sparse import evaluate_band

POINTS_AT_ONCE = 1024
"""Points whose activations are alive together: they stay in the cache, twice as fast on a CPU."""

SAVE_SECONDS = 60.0
POPULATION_SHAPES = 4
"""Shapes of a batch at whose points the effects are held in place."""
MEASURED_ITERATIONS = 20
FOLDING_SHAPES, FOLDING_POINTS = 40, 1000
DIVERGED = 20.0
"""A loss this many times its running mean means that the training has broken down."""


@dataclass(frozen=True)
class Report:
    """What the loop tells after every iteration.

    Attributes:
        iteration: iterations done.
        iterations: iterations of the whole training.
        epoch: passes over the training shapes done.
        losses: the weighted terms of this batch and their ``total``.
        points_per_second: points trained on a second, this run.
        seconds_left: at this speed.
    """

    iteration: int
    iterations: int
    epoch: int
    losses: dict[str, float]
    points_per_second: float
    seconds_left: float


@dataclass
class _State:
    """What changes during a training, and all that a resumed one needs."""

    network: Naisr
    codes: nn.Parameter
    optimiser: torch.optim.Adam
    iteration: int
    iterations: int
    seconds: float

    def to_dict(self) -> dict[str, Any]:
        return {
            "network": self.network.state_dict(),
            "codes": self.codes.detach(),
            "optimiser": self.optimiser.state_dict(),
            "iteration": self.iteration,
            "iterations": self.iterations,
            "seconds": self.seconds,
        }

    def load(self, record: dict[str, Any]) -> None:
        self.network.load_state_dict(record["network"])
        self.codes.data.copy_(record["codes"])
        self.optimiser.load_state_dict(record["optimiser"])
        self.iteration = record["iteration"]
        self.iterations = record["iterations"]
        self.seconds = record["seconds"]


def train(
    store: SampleStore,
    preset: Preset,
    out: Path,
    *,
    time_budget_s: float | None = None,
    report: Callable[[Report], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
    device: str = "cpu",
) -> Checkpoint:
    """Train an atlas on the store's training rows and write it to ``out``.

    ``out`` is a usable atlas from the first minute on. Beside it, ``<out>.training/`` keeps the
    state to resume from, the TensorBoard log and the template at the chosen epochs.

    Args:
        store: prepared samples.
        preset: networks and settings.
        out: the checkpoint to write.
        time_budget_s: bounds the training: the number of iterations is cut to what fits, judged by
            the first iterations.
        report: called after every iteration.
        should_stop: polled before every iteration.
        device: where torch computes.

    Returns:
        The checkpoint that was written.

    Raises:
        InputError: when the loss becomes NaN or breaks away; the last good state is kept.
        Cancelled: when ``should_stop()`` turned true; the state reached is kept.
    """
    config, folder = preset.training, out.with_name(out.name + ".training")
    rows = np.flatnonzero(~store.population.held_out)
    normalised = store.population.normalised()[rows]
    covariates = torch.as_tensor(normalised, dtype=torch.float32, device=device)
    binary = _binary_columns(store)
    projection = _projection(config, normalised, binary).to(device)
    state = _initial_state(preset, len(rows), len(store.population.covariates), device)
    state.iterations = config.epochs * math.ceil(len(rows) / config.batch_shapes)
    if _resume(state, folder / "state.pt", preset):
        state.network.to(device)
    saved_at, began, first = time.monotonic(), time.monotonic(), state.iteration
    running = math.nan
    with _Log(folder / "tensorboard") as log:
        while state.iteration < state.iterations:
            if should_stop is not None and should_stop():
                _save(state, store, preset, out, folder, projection)
                raise Cancelled
            started = time.monotonic()
            chosen = _batch_rows(config, len(rows), state.iteration)
            draw = store.draw(
                rows[chosen].tolist(),
                config.surface_points,
                config.near_points,
                config.uniform_points,
                np.random.default_rng([config.seed, 1, state.iteration]),
            )
            batch = Batch.from_arrays(*draw, device=device)
            losses = _step(state, batch, chosen, covariates, projection, binary, config)
            if not losses["total"] < DIVERGED * max(running, 1e-3) and not math.isnan(running):
                raise InputError(_divergence_message(losses["total"], state, config, out))
            running = losses["total"] if math.isnan(running) else 0.98 * running + 0.02 * losses["total"]
            state.iteration += 1
            state.seconds += time.monotonic() - started
            done = state.iteration - first
            if time_budget_s is not None and done == MEASURED_ITERATIONS and first == 0:
                state.iterations = min(state.iterations, max(done, int(done * time_budget_s / state.seconds)))
            told = _report(state, config, len(rows), losses, (time.monotonic() - began) / done)
            log.add(told)
            _keep_template(state, store, config, folder, told.epoch, len(rows))
            if report is not None:
                report(told)
            if time.monotonic() - saved_at > SAVE_SECONDS:
                _save(state, store, preset, out, folder, projection)
                saved_at = time.monotonic()
    measured = {"folded_share": _folded_share(state, store, covariates, projection)}
    return _save(state, store, preset, out, folder, projection, measured)


def _binary_columns(store: SampleStore) -> tuple[int, ...]:
    return tuple(i for i, c in enumerate(store.population.covariates) if c.kind == "binary")


def _projection(config: TrainingConfig, normalised: NDArray[np.float64], binary: tuple[int, ...]) -> Tensor:
    """Orthonormal columns that are taken out of the codes; none when they are free."""
    if not config.residual_latents:
        return torch.zeros(len(normalised), 0)
    return torch.as_tensor(smooth_basis(normalised, binary), dtype=torch.float32)


def _initial_state(preset: Preset, shapes: int, covariates: int, device: str) -> _State:
    config = preset.training
    with torch.random.fork_rng():
        torch.manual_seed(config.seed)
        network = Naisr(preset.network, covariates).to(device)
        codes = torch.randn(shapes, preset.network.latent) * config.loss.latent_sigma
    parameter = nn.Parameter(codes.to(device))
    optimiser = torch.optim.Adam(
        [
            {"params": list(network.template_network.parameters())},
            {"params": list(network.displacement_networks.parameters())},
            {"params": [parameter]},
        ]
    )
    return _State(network, parameter, optimiser, 0, 0, 0.0)


def _batch_rows(config: TrainingConfig, shapes: int, iteration: int) -> NDArray[np.intp]:
    """Training shapes of one batch: every epoch is a fresh permutation."""
    epoch, index = divmod(iteration, math.ceil(shapes / config.batch_shapes))
    order = np.random.default_rng([config.seed, 0, epoch]).permutation(shapes)
    return order[index * config.batch_shapes : (index + 1) * config.batch_shapes]


def _step(
    state: _State,
    batch: Batch,
    chosen: NDArray[np.intp],
    covariates: Tensor,
    projection: Tensor,
    binary: tuple[int, ...],
    config: TrainingConfig,
) -> dict[str, float]:
    """One optimiser step; returns the weighted terms and their total."""
    _set_rates(state, config)
    state.optimiser.zero_grad()
    residual = residual_latents(state.codes, projection)[chosen]
    with_code = _with_code(config, len(chosen), state.iteration / state.iterations).to(residual.device)
    leaf = (residual * with_code).detach().requires_grad_()
    sums: dict[str, float] = {}
    shapes_at_once = max(1, POINTS_AT_ONCE // config.shape_points)
    for start in range(0, len(chosen), shapes_at_once):
        stop = min(start + shapes_at_once, len(chosen))
        terms = reconstruction_terms(
            state.network,
            batch.narrow(start, stop),
            covariates[chosen[start:stop]],
            leaf[start:stop],
            config.loss,
        )
        _accumulate(terms, (stop - start) / len(chosen), sums)
    _accumulate(latent_term(leaf, config.loss), 1.0, sums)
    few = chosen[:POPULATION_SHAPES]
    points = batch.space_points[: len(few)]
    _accumulate(population_terms(state.network, points, covariates[few], binary, config.loss), 1.0, sums)
    assert leaf.grad is not None
    (residual * with_code).backward(leaf.grad)
    state.optimiser.step()
    return sums | {"total": sum(sums.values())}


def residual_latents(codes: Tensor, basis: Tensor) -> Tensor:
    """The codes ``[n, L]`` less their projection on orthonormal columns ``basis [n, K]``."""
    return codes - basis @ (basis.T @ codes)


def _set_rates(state: _State, config: TrainingConfig) -> None:
    share = state.iteration / state.iterations
    factor = 0.5 * (1 + math.cos(math.pi * share)) if config.cosine else 1.0
    rates = (config.template_rate, config.displacement_rate, config.latent_rate)
    for group, rate in zip(state.optimiser.param_groups, rates, strict=True):
        group["lr"] = rate * factor


def _with_code(config: TrainingConfig, shapes: int, share: float) -> Tensor:
    """1 for the shapes of a batch that use their code, 0 for those trained at z = 0; ``[shapes, 1]``."""
    with_code = torch.ones(shapes, 1)
    if share < config.population_share:
        with_code[:] = 0
    with_code[: round(config.anchor_share * shapes)] = 0
    return with_code


def _accumulate(terms: dict[str, Tensor], share: float, sums: dict[str, float]) -> None:
    if not terms:
        return
    (share * torch.stack(list(terms.values())).sum()).backward()
    for name, term in terms.items():
        sums[name] = sums.get(name, 0.0) + share * float(term.detach())


def _report(
    state: _State, config: TrainingConfig, shapes: int, losses: dict[str, float], seconds_each: float
) -> Report:
    points = config.batch_shapes * config.shape_points
    return Report(
        iteration=state.iteration,
        iterations=state.iterations,
        epoch=state.iteration // math.ceil(shapes / config.batch_shapes),
        losses=losses,
        points_per_second=points / seconds_each,
        seconds_left=(state.iterations - state.iteration) * seconds_each,
    )


def _divergence_message(total: float, state: _State, config: TrainingConfig, out: Path) -> str:
    kept = f"the last good state is in {out}" if out.exists() else "no good state had been reached"
    return (
        f"the training broke down at iteration {state.iteration} (loss {total:.3g}); {kept}; "
        f"try again with a template_rate below {config.template_rate:g}, a displacement_rate below "
        f"{config.displacement_rate:g} or a lower omega0"
    )


def _keep_template(
    state: _State, store: SampleStore, config: TrainingConfig, folder: Path, epoch: int, shapes: int
) -> None:
    """Write the template as a mesh when one of the chosen epochs has just ended."""
    ended = state.iteration % math.ceil(shapes / config.batch_shapes) == 0
    if not ended or epoch not in config.template_epochs or store.frame.dim != 3:
        return
    lattice = Lattice(64)
    mesh = isosurface(evaluate_band(template_field(state.network), lattice), lattice, store.frame)
    if len(mesh.faces):
        with replacing(folder / "templates" / f"epoch_{epoch:05d}.ply") as temporary:
            mesh.export(temporary)


def _folded_share(state: _State, store: SampleStore, covariates: Tensor, projection: Tensor) -> float:
    """Share of surface points of the training shapes, with their codes, where p + d(p) folds."""
    rows = np.flatnonzero(~store.population.held_out)
    latents = residual_latents(state.codes.detach(), projection)
    rng, shares = np.random.default_rng(0), []
    count = min(FOLDING_POINTS, int(store.options["surface_samples"]))
    for index in rng.permutation(len(rows))[:FOLDING_SHAPES]:
        points = store.draw([int(rows[index])], count, 1, 1, rng).surface_points[0]
        shares.append(folded(state.network, points, covariates[index], latents[index]).mean())
    return float(np.mean(shares))


def _save(
    state: _State,
    store: SampleStore,
    preset: Preset,
    out: Path,
    folder: Path,
    projection: Tensor,
    measured: dict[str, float] | None = None,
) -> Checkpoint:
    latents = residual_latents(state.codes.detach(), projection)
    checkpoint = Checkpoint(
        name=store.name,
        preset=preset,
        weights={name: tensor.clone() for name, tensor in state.network.state_dict().items()},
        latents=latents.numpy(force=True),
        population=store.population,
        frame=store.frame,
        alignment=store.alignment,
        source=store.source,
        training={
            "iterations": state.iteration,
            "planned_iterations": state.iterations,
            "seconds": round(state.seconds, 1),
            **(measured or {}),
        },
    )
    checkpoints.save(out, checkpoint)
    with replacing(folder / "state.pt") as temporary:
        torch.save(state.to_dict() | {"preset": repr(preset)}, temporary)
    return checkpoint


def _resume(state: _State, path: Path, preset: Preset) -> bool:
    if not path.exists():
        return False
    try:
        record = torch.load(path, weights_only=True)
    except Exception as error:
        raise InputError(f"{path} cannot be read ({error}); delete its folder to start again") from error
    if record["preset"] != repr(preset):
        raise InputError(
            f"{path.parent} holds a training with other settings; delete it to start again, "
            f"or give another --out"
        )
    state.load(record)
    return True


class _Log:
    """TensorBoard scalars, one point every ten iterations."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __enter__(self) -> _Log:
        from torch.utils.tensorboard import SummaryWriter

        self.writer = SummaryWriter(str(self.folder))
        return self

    def __exit__(self, *_: object) -> None:
        self.writer.close()

    def add(self, report: Report) -> None:
        """Log this iteration's losses."""
        if report.iteration % 10:
            return
        for name, value in report.losses.items():
            self.writer.add_scalar(f"loss/{name}", value, report.iteration)
        self.writer.add_scalar("points_per_second", report.points_per_second, report.iteration)
