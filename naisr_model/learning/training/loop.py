"""Training: one loop over random batches of shapes, resumable at any moment.

Every draw is a function of (seed, iteration), so a training that was killed and started again ends
with the same weights as one that was not.
"""

from __future__ import annotations

import hashlib
import json
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
from naisr_model.config import LossWeights, Preset, TrainingConfig
from naisr_model.data.store import SampleStore
from naisr_model.errors import Cancelled, InputError
from naisr_model.files import replacing
from naisr_model.learning.training.objective import Batch, latent_term, population_terms, reconstruction_terms
from naisr_model.learning.training.residual import covariate_basis
from naisr_model.models.base import AdditiveModel, DeformableModel, ShapeModel, deformable
from naisr_model.models.devices import usable_device
from naisr_model.models.factory import build, model_class
from naisr_model.progress import SILENT, Progress
from naisr_model.surface.fields import template_field
from naisr_model.surface.folding import folded_shares
from naisr_model.surface.isosurface import isosurface
from naisr_model.surface.lattice import Lattice
from naisr_model.surface.sparse import evaluate_band

POINTS_AT_ONCE = 1024
"""Points whose activations are alive together: they stay in the cache, twice as fast on a CPU."""

POPULATION_SHAPES = 4
"""Shapes of a batch at whose points the effects are held in place."""

SAVE_SECONDS = 60.0
FOLDING_SHAPES = 20

DIVERGED = 20.0
"""A loss this many times its best running mean means that the training has broken down."""


@dataclass(frozen=True)
class Report:
    """What the loop tells after every iteration.

    Attributes:
        iteration: iterations done.
        share: how much of the training is done, 0 to 1.
        epoch: passes over the training shapes done.
        losses: the weighted terms of this batch and their ``total``.
        points_per_second: points trained on a second, this run.
        seconds_left: at this speed.
    """

    iteration: int
    share: float
    epoch: int
    losses: dict[str, float]
    points_per_second: float
    seconds_left: float


@dataclass(frozen=True, eq=False)
class _Task:
    """What does not change during a training.

    Attributes:
        store: the samples.
        preset: networks and settings.
        out: the checkpoint to write.
        budget_s: seconds the training may take; infinite when it is bounded by epochs alone.
        rows: the store's training rows, ``[n]``.
        covariates: centred, of those rows, ``[n, N]``; those that the model depends on.
        basis: orthonormal columns that are taken out of the codes, ``[n, K]``; none when they are free.
        binary: columns of binary covariates.
    """

    store: SampleStore
    preset: Preset
    out: Path
    budget_s: float
    rows: NDArray[np.intp]
    covariates: Tensor
    basis: Tensor
    binary: tuple[int, ...]

    @property
    def config(self) -> TrainingConfig:
        return self.preset.training

    @property
    def folder(self) -> Path:
        """Where the state, the log and the templates are kept."""
        return self.out.with_name(self.out.name + ".training")

    @property
    def epoch_iterations(self) -> int:
        return math.ceil(len(self.rows) / self.config.batch_shapes)

    @property
    def iterations(self) -> int:
        return self.config.epochs * self.epoch_iterations

    @property
    def fingerprint(self) -> str:
        """Changes with the settings and with the data, which a resumed training must share."""
        known = [repr(self.preset), self.store.folders, self.store.population.to_json()]
        return hashlib.sha256(json.dumps(known).encode()).hexdigest()


@dataclass
class _State:
    """What changes during a training, and all that a resumed one needs.

    ``best`` is the lowest running mean of the loss so far, ``running`` the present one.
    """

    model: ShapeModel
    codes: nn.Parameter
    optimiser: torch.optim.Adam
    iteration: int = 0
    seconds: float = 0.0
    running: float = math.inf
    best: float = math.inf

    def to_dict(self) -> dict[str, Any]:
        numbers = {name: getattr(self, name) for name in ("iteration", "seconds", "running", "best")}
        return numbers | {
            "network": self.model.state_dict(),
            "codes": self.codes.detach(),
            "optimiser": self.optimiser.state_dict(),
        }

    def load(self, record: dict[str, Any]) -> None:
        self.model.load_state_dict(record["network"])
        self.codes.data.copy_(record["codes"])
        self.optimiser.load_state_dict(record["optimiser"])
        for name in ("iteration", "seconds", "running", "best"):
            setattr(self, name, record[name])

    def share(self, task: _Task) -> float:
        """How much is done, by iterations or by the time budget, whichever is nearer to its end."""
        return max(self.iteration / task.iterations, self.seconds / task.budget_s)


def train(
    store: SampleStore,
    preset: Preset,
    out: Path,
    *,
    time_budget_s: float = math.inf,
    report: Callable[[Report], None] | None = None,
    progress: Progress = SILENT,
    device: str = "cpu",
) -> Checkpoint:
    """Train an atlas on the store's training rows and write it to ``out``.

    ``out`` is a usable atlas from the first minute on. Beside it, ``<out>.training/`` keeps the
    state to resume from, the TensorBoard log and the template at the chosen epochs.

    Args:
        store: prepared samples.
        preset: networks and settings.
        out: the checkpoint to write.
        time_budget_s: ends the training after so many seconds, earlier stops included; the learning
            rates then follow the clock, so only a training without it gives the same result twice.
        report: called after every iteration.
        progress: told the finished share, checked once an iteration.
        device: where torch computes.

    Returns:
        The checkpoint that was written.

    Raises:
        InputError: when settings and data do not fit, or when the loss becomes NaN or breaks away; the
            last good state is kept.
        Cancelled: when nobody waits for it any more; the state reached is kept.
    """
    task = _task(store, preset, out, time_budget_s, device)
    state = _initial_state(preset, len(task.rows), len(store.population.covariates), device)
    _resume(state, task)
    first, began, saved = state.iteration, time.monotonic(), time.monotonic()
    with _Log(task.folder / "tensorboard", state.iteration) as log:
        while state.share(task) < 1:
            started = time.monotonic()
            losses = _accumulate_gradients(state, task)
            _judge(losses["total"], state, task)
            # Only weights whose loss was just found sound are ever written.
            is_unwanted = progress.is_unwanted()
            if is_unwanted or started - saved > SAVE_SECONDS:
                _save(state, task)
                saved = time.monotonic()
            if is_unwanted:
                raise Cancelled
            state.optimiser.step()
            state.iteration += 1
            _keep_template(state, task)
            state.seconds += time.monotonic() - started
            told = _report(state, task, losses, (time.monotonic() - began) / (state.iteration - first))
            log.add(told)
            progress.tell(min(1.0, told.share))
            if report is not None:
                report(told)
    _save(state, task)
    return _save(state, task, _measured(state, task))


def _task(store: SampleStore, preset: Preset, out: Path, budget_s: float, device: str) -> _Task:
    if preset.network.dim != store.frame.dim:
        raise InputError(
            f"the preset is for {preset.network.dim}D shapes and the store holds {store.frame.dim}D ones; "
            f"choose another preset"
        )
    _check(preset)
    usable_device(device)
    population = model_class(preset.model).relevant(store.population)
    rows = np.flatnonzero(~population.held_out)
    normalised = population.normalised()[rows]
    binary = tuple(i for i, c in enumerate(population.covariates) if c.kind == "binary")
    basis = covariate_basis(normalised, binary) if preset.training.residual_latents else normalised[:, :0]
    return _Task(
        store=store,
        preset=preset,
        out=out,
        budget_s=budget_s,
        rows=rows,
        covariates=torch.as_tensor(normalised, dtype=torch.float32, device=device),
        basis=torch.as_tensor(basis, dtype=torch.float32, device=device),
        binary=binary,
    )


def _check(preset: Preset) -> None:
    """Refuse settings that say something of covariates or of a template to a model without them."""
    config, model = preset.training, model_class(preset.model)
    can, loss = model.capabilities, config.loss
    wanted = (
        ("population_share", config.population_share, can.evolvable),
        ("residual_latents", config.residual_latents, can.evolvable),
        ("template_epochs", config.template_epochs, can.has_template),
        ("loss.template_eikonal", loss.template_eikonal, can.has_template),
        ("loss.folding", loss.folding, can.deformable),
        ("loss.centring", loss.centring, issubclass(model, AdditiveModel)),
        ("loss.ridge", loss.ridge, issubclass(model, AdditiveModel)),
    )
    for name, value, is_possible in wanted:
        if value and not is_possible:
            raise InputError(
                f"the setting 'training.{name}' is {value}, but {model.title} has no use for it; leave it out"
            )


def _initial_state(preset: Preset, shapes: int, covariates: int, device: str) -> _State:
    config = preset.training
    with torch.random.fork_rng():
        torch.manual_seed(config.seed)
        model = build(preset, covariates).to(device)
        codes = torch.randn(shapes, preset.network.latent) * config.loss.latent_sigma
    parameter = nn.Parameter(codes.to(device))
    rated = model.rated_parameters() | {"latent_rate": [parameter]}
    optimiser = torch.optim.Adam([{"params": own, "setting": name} for name, own in rated.items()])
    return _State(model, parameter, optimiser)


def _batch_indices(task: _Task, iteration: int) -> NDArray[np.intp]:
    """Training shapes of one batch; every epoch is a fresh permutation."""
    epoch, index = divmod(iteration, task.epoch_iterations)
    order = np.random.default_rng([task.config.seed, 0, epoch]).permutation(len(task.rows))
    return order[index * task.config.batch_shapes : (index + 1) * task.config.batch_shapes]


def _draw(task: _Task, chosen: NDArray[np.intp], iteration: int) -> Batch:
    config = task.config
    counts = config.surface_points, config.near_points, config.uniform_points
    rng = np.random.default_rng([config.seed, 1, iteration])
    arrays = task.store.draw(task.rows[chosen].tolist(), *counts, rng)
    return Batch.from_arrays(*arrays, device=task.covariates.device)


def _accumulate_gradients(state: _State, task: _Task) -> dict[str, float]:
    """Forward and backward through the batch of this iteration; the weighted terms and their total."""
    config, chosen = task.config, _batch_indices(task, state.iteration)
    _set_rates(state, config, state.share(task))
    state.optimiser.zero_grad()
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
    shapes_at_once = max(1, POINTS_AT_ONCE // count)
    for start in range(0, shapes, shapes_at_once):
        part = slice(start, min(start + shapes_at_once, shapes))
        terms = reconstruction_terms(model, batch.narrow(part), covariates[part], latents[part], weights)
        _accumulate(terms, (part.stop - part.start) / shapes, sums)
    return sums


def _judge(total: float, state: _State, task: _Task) -> None:
    """Follow the loss, and stop where it has become NaN or has broken away."""
    if not math.isfinite(total) or total > DIVERGED * max(state.best, 1e-3):
        raise InputError(_divergence_message(total, state, task))
    state.running = total if math.isinf(state.running) else 0.98 * state.running + 0.02 * total
    state.best = min(state.best, state.running)


def residual_latents(codes: Tensor, basis: Tensor) -> Tensor:
    """The codes ``[n, L]`` less their projection on orthonormal columns ``basis [n, K]``."""
    return codes - basis @ (basis.T @ codes)


def _set_rates(state: _State, config: TrainingConfig, share: float) -> None:
    factor = 0.5 * (1 + math.cos(math.pi * share)) if config.cosine else 1.0
    for group in state.optimiser.param_groups:
        group["lr"] = getattr(config, group["setting"]) * factor


def _accumulate(terms: dict[str, Tensor], share: float, sums: dict[str, float]) -> None:
    if not terms:
        return
    (share * torch.stack(list(terms.values())).sum()).backward()
    for name, term in terms.items():
        sums[name] = sums.get(name, 0.0) + share * float(term.detach())


def _report(state: _State, task: _Task, losses: dict[str, float], seconds_each: float) -> Report:
    epoch = state.iteration // task.epoch_iterations
    points = len(task.rows) * task.config.shape_points / task.epoch_iterations
    left = min((task.iterations - state.iteration) * seconds_each, task.budget_s - state.seconds)
    return Report(state.iteration, state.share(task), epoch, losses, points / seconds_each, max(0.0, left))


def _divergence_message(total: float, state: _State, task: _Task) -> str:
    config, out = task.config, task.out
    lower = [f"a {name} below {getattr(config, name):g}" for name in state.model.rated_parameters()]
    kept = f"the last good state is in {out}" if out.exists() else "no good state had been saved"
    return (
        f"the training broke down at iteration {state.iteration} (loss {total:.3g}); {kept}; try again "
        f"under another name with {', '.join(lower)} or a lower omega0"
    )


def _keep_template(state: _State, task: _Task) -> None:
    """Write the template as a mesh when one of the chosen epochs has just ended."""
    epoch, rest = divmod(state.iteration, task.epoch_iterations)
    if rest or epoch not in task.config.template_epochs or task.store.frame.dim != 3:
        return
    lattice = Lattice(64)
    mesh = isosurface(
        evaluate_band(template_field(deformable(state.model)), lattice), lattice, task.store.frame
    )
    if len(mesh.faces):
        with replacing(task.folder / "templates" / f"epoch_{epoch:05d}.ply") as temporary:
            mesh.export(temporary)


def _measured(state: _State, task: _Task) -> dict[str, float]:
    """Of surfaces that a template is deformed to, the share that folds."""
    if task.store.frame.dim != 3 or not isinstance(state.model, DeformableModel):
        return {}
    return {"folded_share": _folded_share(state.model, state, task)}


def _folded_share(model: DeformableModel, state: _State, task: _Task) -> float:
    """Mean share of folded points near the surfaces of some training shapes, with their codes."""
    some = np.random.default_rng(0).permutation(len(task.rows))[:FOLDING_SHAPES]
    latents = residual_latents(state.codes.detach(), task.basis)[some]
    return float(np.mean(folded_shares(model, task.covariates[some], latents, resolution=64)))


def _save(state: _State, task: _Task, measured: dict[str, float] | None = None) -> Checkpoint:
    store = task.store
    checkpoint = Checkpoint(
        name=store.name,
        preset=task.preset,
        weights={name: tensor.clone() for name, tensor in state.model.state_dict().items()},
        latents=residual_latents(state.codes.detach(), task.basis).numpy(force=True),
        population=store.population,
        frame=store.frame,
        alignment=store.alignment,
        source=store.source,
        training={
            "iterations": state.iteration,
            "seconds": round(state.seconds, 1),
            **(measured or {}),
        },
    )
    checkpoints.save(task.out, checkpoint)
    with replacing(task.folder / "state.pt") as temporary:
        torch.save(state.to_dict() | {"fingerprint": task.fingerprint}, temporary)
    return checkpoint


def _resume(state: _State, task: _Task) -> None:
    """Go on from the state in the training's folder, if there is one."""
    path = task.folder / "state.pt"
    for left_over in task.folder.glob(".state.*.pt"):  # of a program that was killed while it saved
        left_over.unlink()
    if not path.exists():
        return
    try:
        record = torch.load(path, weights_only=True, map_location=task.covariates.device)
        same = record["fingerprint"] == task.fingerprint
        if same:
            state.load(record)
    except Exception as error:
        raise InputError(f"{path} cannot be read ({error}); delete its folder to start again") from error
    if not same:
        raise InputError(
            f"{task.folder} holds a training with other settings or data; delete it to start again, "
            f"or give another --out"
        )


class _Log:
    """TensorBoard scalars, one point every ten iterations; goes on where a killed one stopped."""

    def __init__(self, folder: Path, iteration: int) -> None:
        self.folder, self.iteration = folder, iteration

    def __enter__(self) -> _Log:
        from torch.utils.tensorboard import SummaryWriter

        self.writer = SummaryWriter(str(self.folder), purge_step=self.iteration + 1)
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
