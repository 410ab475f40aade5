"""One ``.safetensors`` file holds a whole atlas: weights, codes and a JSON record that explains them.

The format stores arrays and text only, so opening a file never executes anything.
"""

from __future__ import annotations

import hashlib
import itertools
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

from naisr_model import records
from naisr_model.config import Preset, to_json
from naisr_model.covariates import Population
from naisr_model.data import formats
from naisr_model.data.align import Alignment
from naisr_model.errors import InputError
from naisr_model.files import replacing, require_file, why_unreadable
from naisr_model.frames import Frame
from naisr_model.models.base import ShapeModel
from naisr_model.models.factory import MODELS, build, layout, model_of, read_preset

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

    def require_sound(self) -> None:
        """Make sure that the parts fit together and every number is one; the weights' shapes are known to.

        Raises:
            ValueError: with what is wrong.
        """
        trained, length = int(np.sum(~self.population.held_out)), self.preset.network.latent
        if self.latents.shape != (trained, length):
            raise ValueError(
                f"{records.size(self.latents.shape)} codes where {trained} by {length} are expected"
            )
        if self.preset.network.dim != self.frame.dim:
            raise ValueError(f"networks of {self.preset.network.dim}D shapes in a {self.frame.dim}D frame")
        if self.population.covariates and trained < 2:
            raise ValueError("covariates of a single shape")
        if wrong := [name for name, tensor in self.weights.items() if not torch.isfinite(tensor).all()]:
            raise ValueError(f"'{wrong[0]}' holds what is no finite number")
        if not np.isfinite(self.latents).all():
            raise ValueError("the codes hold what is no finite number")
        if not (self._distances().abs() <= FARTHEST).all():
            raise ValueError("its networks give no distances")

    @torch.inference_mode()
    def _distances(self) -> Tensor:
        """Phi at the corners and the middle of the box, at the centre and both ends of the covariates."""
        dim, covariates = self.frame.dim, self.population.covariates
        points = torch.tensor([*itertools.product((-1.0, 1.0), repeat=dim), (0.0,) * dim])
        ends = np.array([c.normalise((c.centre, *c.range)) for c in covariates]).reshape(-1, 3)
        values = torch.as_tensor(ends.T, dtype=torch.float32)
        codes = torch.zeros(3, self.preset.network.latent)
        return self.model()(points.expand(3, -1, -1), values, codes)


def save(path: Path, checkpoint: Checkpoint) -> None:
    """Write ``checkpoint`` to ``path`` in one step."""
    tensors = {
        _WEIGHT + name: tensor.detach().cpu().contiguous() for name, tensor in checkpoint.weights.items()
    }
    tensors[_LATENTS] = torch.as_tensor(checkpoint.latents)
    record = json.dumps(
        {
            "name": checkpoint.name,
            "preset": to_json(checkpoint.preset),
            "population": checkpoint.population.to_json(),
            "frame": checkpoint.frame.to_json(),
            "alignment": checkpoint.alignment.to_json(),
            "source": dict(checkpoint.source),
            "training": dict(checkpoint.training),
        }
    )
    digest = _digest(record, tensors)
    metadata = {"format": FORMAT, "version": str(VERSION), "record": record, "digest": digest}
    with replacing(path) as temporary:
        temporary.write_bytes(in_memory(tensors, metadata))


def load(path: str | Path) -> Checkpoint:
    """Read a checkpoint.

    What is announced is held against what is there before anything large is read or made.

    Raises:
        InputError: for a file that is missing, damaged, foreign, of a newer version or an unknown model.
    """
    path = Path(path)
    require_file(path, "an atlas (.safetensors)")
    try:
        with safe_open(path, framework="pt") as file:
            text, digest = _text(path, file.metadata() or {})
            with _consistent(path):
                record = records.parsed(text)
                model = model_of(records.entry(record, "preset", dict))
            if model not in MODELS:
                raise InputError(
                    f"the atlas in {path} is of the model '{model}', which this program does not know; "
                    "update the program"
                )
            with _consistent(path):
                preset = read_preset(record["preset"])
                population = Population.from_json(records.entry(record, "population", dict))
                expected = _expected(preset, population)
                _require_layout({name: file.get_slice(name) for name in file.keys()}, expected)  # noqa: SIM118
                # A copy: what the reader gives are views of the file, which may be written over.
                tensors = {name: file.get_tensor(name).clone() for name in expected}
    except SafetensorError as error:
        raise InputError(f"{path} {_foreign(path)}") from error
    except OSError as error:
        raise InputError(why_unreadable(path, error)) from error
    with _consistent(path):
        checkpoint = _assemble(record, preset, population, tensors)
        checkpoint.require_sound()
    if digest not in (None, _digest(text, tensors)):
        raise InputError(f"{path} was damaged after it was written; copy it again, or train it again")
    return checkpoint


_OTHERS = {
    b"PK": "a zip archive or a PyTorch file",
    b"\x80\x02": "a pickle",
    b"\x80\x03": "a pickle",
    b"\x80\x04": "a pickle",
    b"\x80\x05": "a pickle",
    b"{": "a JSON file",
}
"""What files begin with that are at hand where an atlas is."""

FARTHEST = 1e6
"""Model units; the box is 2 wide, so no distance is larger."""


def _foreign(path: Path) -> str:
    """What a file is that is no .safetensors file, by its contents, and what to do."""
    content = formats.content_of(path)
    if formats.is_tensors(content):
        return "is not a complete .safetensors file; copy it again, or train it again"
    mesh = formats.format_of(formats.plain(content), path.suffix.lower().removeprefix("."))
    others = [title for magic, title in _OTHERS.items() if content.startswith(magic)]
    what, _ = formats.foreign(content) or ("", "")
    if mesh or "volume" in what:
        what = f"a mesh ({formats.MESHES[mesh]})" if mesh else what
        return (
            f"is {what}, not an atlas; open it as a scan: 'Open scan…' in the window, --scan {path.name} or "
            "'naisr fit' on the command line"
        )
    if others or what:
        return f"is {[*others, what][0]}, not an atlas; give a .safetensors file that 'naisr train' wrote"
    return "is not a complete .safetensors file; copy it again, or train it again"


def _text(path: Path, metadata: Mapping[str, str]) -> tuple[str, str | None]:
    """The record of an atlas and its digest, which files of older programs lack."""
    if metadata.get("format") != FORMAT:
        raise InputError(
            f"{path} is a .safetensors file but not an atlas of this program; "
            "give one that 'naisr train' wrote"
        )
    version = metadata.get("version", "")
    if not version.isdecimal() or int(version[:9]) < 1:
        raise InputError(
            f"{path} is of the unknown version '{version[:20]}'; copy it again, or train it again"
        )
    if int(version[:9]) > VERSION:
        raise InputError(f"{path} was written by a newer version of this program; update the program")
    return metadata.get("record", ""), metadata.get("digest")


def _expected(preset: Preset, population: Population) -> dict[str, tuple[int, ...]]:
    """Shapes of all tensors of an atlas by name."""
    weights = layout(preset, len(population.covariates))
    trained = int(np.sum(~population.held_out))
    named = {_WEIGHT + name: shape for name, shape in weights.items()}
    return {**named, _LATENTS: (trained, preset.network.latent)}


def _require_layout(found: Mapping[str, Any], expected: Mapping[str, tuple[int, ...]]) -> None:
    """Compare the tensors that a file announces with what its record asks for."""
    if missing := sorted(expected.keys() - found.keys()):
        raise ValueError(f"'{missing[0]}' is missing")
    if unknown := sorted(found.keys() - expected.keys()):
        raise ValueError(f"'{unknown[0]}' belongs to no network of it")
    for name, shape in expected.items():
        if (is_there := tuple(found[name].get_shape())) != shape:
            raise ValueError(f"'{name}' is {records.size(is_there)} where {records.size(shape)} is expected")
        if found[name].get_dtype() != "F32":
            raise ValueError(f"'{name}' is of the type {found[name].get_dtype()} where F32 is expected")


def _digest(record: str, tensors: Mapping[str, Tensor]) -> str:
    """SHA-256 of all that a file says: a copy that went wrong in a single bit is another one."""
    digest = hashlib.sha256(record.encode())
    for name in sorted(tensors):
        digest.update(name.encode())
        digest.update(tensors[name].numpy().tobytes())
    return digest.hexdigest()


@contextmanager
def _consistent(path: Path) -> Iterator[None]:
    """Says in a sentence what does not fit together."""
    try:
        yield
    except (ValueError, KeyError, TypeError, RuntimeError, AttributeError, OverflowError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(
            f"the atlas in {path} contradicts itself ({reason}); copy it again, or train it again"
        ) from error


def _assemble(
    record: dict[str, Any], preset: Preset, population: Population, tensors: dict[str, Tensor]
) -> Checkpoint:
    return Checkpoint(
        name=records.entry(record, "name", str),
        preset=preset,
        weights={k.removeprefix(_WEIGHT): v for k, v in tensors.items() if k.startswith(_WEIGHT)},
        latents=tensors[_LATENTS].numpy(),
        population=population,
        frame=Frame.from_json(records.entry(record, "frame", dict)),
        alignment=Alignment.from_json(records.entry(record, "alignment", dict)),
        source=records.scalars(record, "source"),
        training=records.figures(record, "training"),
    )
