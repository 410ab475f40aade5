"""One ``.safetensors`` file holds a whole atlas: weights, codes and a JSON record that explains them.

The format stores arrays and text only, so opening a file never executes anything.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.torch import save as in_memory
from torch import Tensor

from naisr_model.config import Preset, to_json
from naisr_model.covariates import Population
from naisr_model.data.align import Alignment
from naisr_model.errors import InputError
from naisr_model.files import replacing
from naisr_model.frames import Frame
from naisr_model.models.base import ShapeModel
from naisr_model.models.factory import MODELS, build, model_of, read_preset

FORMAT = "naisr-atlas"
VERSION = 1
_WEIGHT = "network."
_LATENTS = "latents"


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """Everything that is known of a trained atlas.

    Attributes:
        name: of the population, for example ``airway``.
        preset: the model, its sizes and training settings.
        weights: state dictionary of the model.
        latents: codes of the training rows in population order, float32 ``[n_train, L]``.
        population: all rows, held-out ones included, with the covariates.
        frame: millimetres to model units.
        alignment: how a scan was moved to the atlas frame.
        source: how the data were made; empty for a user's own.
        training: what the training measured (iterations, seconds, final losses, folded share).
    """

    name: str
    preset: Preset
    weights: Mapping[str, Tensor]
    latents: NDArray[np.float32]
    population: Population
    frame: Frame
    alignment: Alignment
    source: Mapping[str, Any]
    training: Mapping[str, Any]

    def model(self) -> ShapeModel:
        """The shape model with these weights, ready for inference."""
        model = build(self.preset, len(self.population.covariates))
        model.load_state_dict(dict(self.weights))
        return model.eval()


def save(path: Path, checkpoint: Checkpoint) -> None:
    """Write ``checkpoint`` to ``path`` in one step."""
    tensors = {
        _WEIGHT + name: tensor.detach().cpu().contiguous() for name, tensor in checkpoint.weights.items()
    }
    tensors[_LATENTS] = torch.as_tensor(checkpoint.latents)
    record = {
        "name": checkpoint.name,
        "preset": to_json(checkpoint.preset),
        "population": checkpoint.population.to_json(),
        "frame": checkpoint.frame.to_json(),
        "alignment": checkpoint.alignment.to_json(),
        "source": dict(checkpoint.source),
        "training": dict(checkpoint.training),
    }
    metadata = {"format": FORMAT, "version": str(VERSION), "record": json.dumps(record)}
    with replacing(path) as temporary:
        temporary.write_bytes(in_memory(tensors, metadata))


def load(path: str | Path) -> Checkpoint:
    """Read a checkpoint.

    Raises:
        InputError: for a file that is missing, damaged, foreign, of a newer version or an unknown model.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"there is no atlas at {path}")
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except (SafetensorError, OSError) as error:
        raise InputError(
            f"{path} is not a complete .safetensors file ({error}); copy or train it again"
        ) from error
    if metadata.get("format") != FORMAT:
        raise InputError(f"{path} is a .safetensors file but not an atlas of this program")
    if int(metadata.get("version", 0)) > VERSION:
        raise InputError(f"{path} was written by a newer version of this program; update the program")
    with _consistent(path):
        record = json.loads(metadata["record"])
        model = model_of(record["preset"])
    if model not in MODELS:
        raise InputError(
            f"the atlas in {path} is of the model '{model}', which this program does not know; "
            "update the program"
        )
    with _consistent(path):
        checkpoint = _assemble(record, tensors)
        checkpoint.model()
    return checkpoint


@contextmanager
def _consistent(path: Path) -> Iterator[None]:
    """Says in a sentence what does not fit together."""
    try:
        yield
    except (KeyError, TypeError, ValueError, RuntimeError, AttributeError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"the atlas in {path} contradicts itself ({reason}); train it again") from error


def _assemble(record: dict[str, Any], tensors: dict[str, Tensor]) -> Checkpoint:
    return Checkpoint(
        name=str(record["name"]),
        preset=read_preset(record["preset"]),
        weights={k.removeprefix(_WEIGHT): v for k, v in tensors.items() if k.startswith(_WEIGHT)},
        latents=tensors[_LATENTS].numpy(),
        population=Population.from_json(record["population"]),
        frame=Frame.from_json(record["frame"]),
        alignment=Alignment.from_json(record["alignment"]),
        source=record["source"],
        training=record["training"],
    )
