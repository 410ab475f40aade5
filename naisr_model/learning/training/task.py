"""A training as values: what does not change while it runs, and what does."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass
from pathlib import Path
from reprlib import repr as shortened
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from naisr_model.config import Preset, TrainingConfig, require_ranges
from naisr_model.data.store import SampleStore
from naisr_model.errors import InputError
from naisr_model.learning.training.muon import Muon
from naisr_model.learning.training.residual import covariate_basis
from naisr_model.models.base import ShapeModel
from naisr_model.models.devices import usable_device
from naisr_model.models.factory import build, layout, model_class

MOMENTS = {torch.optim.Adam: ("exp_avg", "exp_avg_sq"), Muon: ("momentum",)}
"""What each optimiser remembers of a parameter, in its shape."""


@dataclass(frozen=True, eq=False)
class Task:
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
        """How it is optimised."""
        return self.preset.training

    @property
    def folder(self) -> Path:
        """Where the state, the log and the templates are kept."""
        return self.out.with_name(self.out.name + ".training")

    @property
    def epoch_iterations(self) -> int:
        """Batches that show every shape once."""
        return math.ceil(len(self.rows) / self.config.batch_shapes)

    @property
    def iterations(self) -> int:
        """Of the whole training, where no budget ends it."""
        return self.config.epochs * self.epoch_iterations

    @property
    def fingerprint(self) -> str:
        """Changes with the settings and with the data, which a resumed training must share."""
        known = [repr(self.preset), self.store.folders, self.store.population.to_json()]
        return hashlib.sha256(json.dumps(known).encode()).hexdigest()


@dataclass
class State:
    """What changes during a training, and all that a resumed one needs.

    Attributes:
        model: in training.
        codes: of the training shapes before anything is taken out of them, ``[n, L]``.
        optimisers: of both; each of their groups names the setting that is its learning rate, and what part
            of it.
        iteration: iterations done.
        seconds: spent on them, earlier runs included.
        running: mean of the loss of late.
        best: the lowest such mean so far.
    """

    model: ShapeModel
    codes: nn.Parameter
    optimisers: tuple[torch.optim.Optimizer, ...]
    iteration: int = 0
    seconds: float = 0.0
    running: float = math.inf
    best: float = math.inf

    def to_dict(self) -> dict[str, Any]:
        """Tensors and numbers that :meth:`load` reads back."""
        numbers = {name: getattr(self, name) for name in ("iteration", "seconds", "running", "best")}
        return numbers | {
            "network": self.model.state_dict(),
            "codes": self.codes.detach(),
            "optimisers": [optimiser.state_dict() for optimiser in self.optimisers],
        }

    def load(self, record: dict[str, Any]) -> None:
        """Become the state that :meth:`to_dict` gave.

        Raises:
            ValueError: for what that never gives; this state is then as it was, or half the other.
        """
        if not isinstance(record["iteration"], int) or record["iteration"] < 0:
            raise ValueError(f"{shortened(record['iteration'])} iterations")
        moments = [kept["state"] for kept in record["optimisers"]]
        for optimiser, known in zip(self.optimisers, moments, strict=True):
            parameters = [parameter for group in optimiser.param_groups for parameter in group["params"]]
            for number, own in known.items():
                for name in MOMENTS[type(optimiser)]:
                    _require_like(own[name], parameters[number])
        for name, weight in self.model.state_dict().items():
            _require_like(record["network"][name], weight)
        _require_like(record["codes"], self.codes)
        self.model.load_state_dict(record["network"])
        self.codes.data.copy_(record["codes"])
        for optimiser, known in zip(self.optimisers, moments, strict=True):
            groups = optimiser.state_dict()["param_groups"]
            optimiser.load_state_dict({"state": known, "param_groups": groups})
        for name in ("iteration", "seconds", "running", "best"):
            value = record[name]
            if (
                isinstance(value, bool)
                or not isinstance(value, int | float)
                or not value >= 0
                or (name == "seconds" and math.isinf(value))
            ):
                raise ValueError(f"'{name}' is {shortened(value)}")
            setattr(self, name, value)

    @property
    def is_finite(self) -> bool:
        """Whether all weights and codes are numbers."""
        tensors = (*self.model.state_dict().values(), self.codes)
        return all(bool(torch.isfinite(tensor).all()) for tensor in tensors)

    def share(self, task: Task) -> float:
        """How much is done, by iterations or by the time budget, whichever is nearer to its end."""
        return max(self.iteration / task.iterations, self.seconds / task.budget_s)


def _require_like(found: Tensor, expected: Tensor) -> None:
    """Make sure that a tensor that was kept is one of numbers in the shape of another."""
    if found.shape != expected.shape or not torch.isfinite(found).all():
        raise ValueError(f"weights of {tuple(found.shape)} where {tuple(expected.shape)} are expected")


def make_task(store: SampleStore, preset: Preset, out: Path, budget_s: float, device: str) -> Task:
    """The training that :func:`~naisr_model.learning.training.loop.train` is asked for.

    Raises:
        InputError: when settings, model and data do not fit, or torch cannot compute on ``device``.
    """
    if not out.name or out.is_dir():
        raise InputError(f"'{out}' is a folder; give the name of the .safetensors file to write")
    _check(preset)
    if preset.network.dim != store.frame.dim:
        raise InputError(
            f"the preset is for {preset.network.dim}D shapes and the store holds {store.frame.dim}D ones; "
            f"choose another preset"
        )
    layout(preset, len(store.population.covariates))  # refused before such networks are made
    usable_device(device)
    population = model_class(preset.model).relevant(store.population)
    rows = np.flatnonzero(~population.held_out)
    normalised = population.normalised()[rows]
    binary = tuple(i for i, c in enumerate(population.covariates) if c.kind == "binary")
    basis = covariate_basis(normalised, binary) if preset.training.residual_latents else normalised[:, :0]
    return Task(
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
    """Refuse settings out of their range, and such as say something to a model that has no use for it."""
    require_ranges(preset)
    model, given, neutral = model_class(preset.model), preset.training, TrainingConfig()
    can, loss, none = model.capabilities, given.loss, neutral.loss
    settings = (
        ("population_share", given.population_share, neutral.population_share, can.evolvable),
        ("residual_latents", given.residual_latents, neutral.residual_latents, can.evolvable),
        ("template_epochs", given.template_epochs, neutral.template_epochs, can.has_template),
        ("displacement_rate", given.displacement_rate, neutral.displacement_rate, can.deformable),
        ("loss.template_eikonal", loss.template_eikonal, none.template_eikonal, can.has_template),
        ("loss.folding", loss.folding, none.folding, can.deformable),
        ("loss.underway", loss.underway, none.underway, can.stepwise),
        ("loss.pointwise", loss.pointwise, none.pointwise, can.deformable),
        ("loss.pointpair", loss.pointpair, none.pointpair, can.deformable),
        ("loss.centring", loss.centring, none.centring, can.deformable and can.disentangleable),
        ("loss.ridge", loss.ridge, none.ridge, can.deformable and can.disentangleable),
    )
    for name, value, untouched, is_possible in settings:
        if value != untouched and not is_possible:
            raise InputError(
                f"the setting 'training.{name}' is {value}, but {model.title} has no use for it; leave it out"
            )


def initial_state(task: Task) -> State:
    """Before the first iteration: weights and codes drawn from the seed."""
    config, network, device = task.config, task.preset.network, task.covariates.device
    with torch.random.fork_rng():
        torch.manual_seed(config.seed)
        model = build(task.preset, len(task.store.population.covariates)).to(device)
        codes = torch.randn(len(task.rows), network.latent) * config.loss.latent_sigma
    parameter = nn.Parameter(codes.to(device))
    return State(model, parameter, _optimisers(model, parameter, config))


def _optimisers(
    model: ShapeModel, codes: nn.Parameter, config: TrainingConfig
) -> tuple[torch.optim.Optimizer, ...]:
    """Adam for everything, or for all but the matrices between hidden layers."""
    layers = model.hidden_layers() if config.hidden_rate else []
    taken = {id(matrices) for matrices, _ in layers}
    rated = model.rated_parameters() | {"latent_rate": [codes]}
    groups = [
        {"params": [one for one in own if id(one) not in taken], "setting": name, "part": 1.0}
        for name, own in rated.items()
    ]
    adam = torch.optim.Adam(groups)
    if not layers:
        return (adam,)
    parts = [
        {"params": [matrices], "setting": "hidden_rate", "part": 1 / omega0} for matrices, omega0 in layers
    ]
    return adam, Muon(parts)
