"""What a training keeps on the disk: the atlas, the state to go on from, and the template now and then."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from zipfile import ZipFile

import numpy as np
import torch

from naisr_model import checkpoint as checkpoints
from naisr_model.checkpoint import Checkpoint
from naisr_model.errors import InputError
from naisr_model.files import checked_place, forget_unfinished, replacing
from naisr_model.learning.training.residual import residual_latents
from naisr_model.learning.training.task import State, Task
from naisr_model.models.base import DeformableModel, deformable
from naisr_model.shapes.kinds import kind_of
from naisr_model.surface.fields import template_field
from naisr_model.surface.folding import folded_shares
from naisr_model.surface.isosurface import isosurface
from naisr_model.surface.lattice import Lattice
from naisr_model.surface.sparse import evaluate_band
from naisr_model.work.alone import alone

FOLDING_SHAPES = 20
"""Training shapes whose surfaces are looked at for folds."""


@contextmanager
def held(task: Task) -> Iterator[None]:
    """The files of a training to itself until it ends, without what a killed run left half written.

    Raises:
        InputError: when something else stands at ``out``, or another training writes there.
    """
    checked_place(task.out)
    if task.out.exists() and not _state_file(task).exists():
        raise InputError(
            f"{task.out} is there already, and no training that could go on belongs to it; "
            "give another --out, or move it away"
        )
    told = f"another training writes {task.out}; wait until it has ended, or give another --out"
    with alone(task.folder / ".lock", told):
        forget_unfinished(task.out)
        forget_unfinished(_state_file(task))
        yield


def save(state: State, task: Task, figures: Mapping[str, float] = MappingProxyType({})) -> Checkpoint:
    """Write the state to go on from, and the atlas; ``figures`` stand in the atlas beside the iterations.

    The state comes first: an atlas without one belongs to somebody else.

    Raises:
        InputError: when they cannot be written; what was saved before is whole.
    """
    record = io.BytesIO()  # torch says in words of its own that a disk is full
    torch.save(state.to_dict() | {"fingerprint": task.fingerprint}, record)
    with replacing(_state_file(task)) as temporary:
        temporary.write_bytes(record.getbuffer())
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
        training={"iterations": state.iteration, "seconds": round(state.seconds, 1), **figures},
    )
    checkpoints.save(task.out, checkpoint)
    return checkpoint


def resume(state: State, task: Task) -> None:
    """Go on from the state in the training's folder, if there is one.

    Raises:
        InputError: for a state that cannot be read, or is of other settings or data.
    """
    path = _state_file(task)
    if not path.exists():
        return
    try:
        _require_undamaged(path)
        record = torch.load(path, weights_only=True, map_location=task.covariates.device)
        same = record["fingerprint"] == task.fingerprint
        if same:
            state.load(record)
        if state.iteration > task.iterations:
            raise ValueError(f"{state.iteration} iterations of {task.iterations}")
    except Exception as error:  # torch raises whatever it likes on damaged files
        reason = (str(error).splitlines() or [repr(error)])[0]
        raise InputError(
            f"the training's state {path} cannot be read ({reason}); delete its folder and {task.out.name} "
            "to start again"
        ) from error
    if not same:
        raise InputError(
            f"{task.folder} holds a training with other settings or data; delete it and {task.out.name} to "
            "start again, or give another --out"
        )


def _require_undamaged(path: Path) -> None:
    """Compare the archive with its checksums, which torch does not.

    Raises:
        ValueError: for a part that is another than was written.
    """
    with ZipFile(path) as archive:
        if damaged := archive.testzip():
            raise ValueError(f"{damaged} was damaged after it was written")


def keep_template(state: State, task: Task) -> None:
    """Write the template as a file when one of the chosen epochs has just ended."""
    epoch, rest = divmod(state.iteration, task.epoch_iterations)
    if rest or epoch not in task.config.template_epochs:
        return
    lattice = Lattice(64, task.store.frame.dim)
    shape = isosurface(
        evaluate_band(template_field(deformable(state.model)), lattice), lattice, task.store.frame
    )
    if len(shape.faces):
        kind = kind_of(shape)
        path = task.folder / "templates" / f"epoch_{epoch:05d}{Path(kind.stored).suffix}"
        with replacing(path) as temporary:
            temporary.write_bytes(kind.written(shape))


def measured(state: State, task: Task) -> dict[str, float]:
    """Of surfaces that a template is deformed to, the share that folds."""
    if not isinstance(state.model, DeformableModel):
        return {}
    share = _folded_share(state.model, state, task)
    return {} if np.isnan(share) else {"folded_share": share}


def _state_file(task: Task) -> Path:
    return task.folder / "state.pt"


def _folded_share(model: DeformableModel, state: State, task: Task) -> float:
    """Mean share of folded points near the surfaces of some training shapes; NaN where one has no surface."""
    some = np.random.default_rng(0).permutation(len(task.rows))[:FOLDING_SHAPES]
    latents = residual_latents(state.codes.detach(), task.basis)[some]
    return float(np.mean(folded_shares(model, task.covariates[some], latents, resolution=64)))
