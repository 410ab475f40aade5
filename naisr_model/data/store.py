"""Prepared samples on disk, read in small random pieces.

Layout: ``store.json`` (what the samples are) and, a folder a shape, ``surface.npy``, ``near.npy``,
``uniform.npy`` (shuffled float32 rows, see :class:`~naisr_model.data.samples.ShapeSamples`) and
``mesh.ply``, of curves ``curve.csv`` (aligned, millimetres).
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from naisr_model import records
from naisr_model.covariates import Population
from naisr_model.data.align import Alignment
from naisr_model.errors import InputError
from naisr_model.files import replacing
from naisr_model.frames import Frame
from naisr_model.shapes.kinds import KINDS as SHAPE_KINDS
from naisr_model.shapes.kinds import Shape

VERSION = 1
INDEX = "store.json"
SHAPES = "shapes"
KINDS = ("surface", "near", "uniform")

FARTHEST = 1e6
"""Model units beyond which a sample is damage; the box is 2 wide."""

_NO_SAMPLES = "it holds what is no number or far outside of the box"


class Draw(NamedTuple):
    """A random subset of the samples of ``S`` shapes, float32, model units.

    Attributes:
        surface_points: ``[S, n_surface, dim]``.
        surface_normals: outward unit normals, ``[S, n_surface, dim]``.
        space_points: the near points, then the uniform ones, ``[S, n_near + n_uniform, dim]``.
        space_sdf: signed distance of each space point, negative inside, ``[S, n_near + n_uniform]``.
    """

    surface_points: NDArray[np.float32]
    surface_normals: NDArray[np.float32]
    space_points: NDArray[np.float32]
    space_sdf: NDArray[np.float32]


class _Block(NamedTuple):
    """Where the rows of one ``.npy`` file begin and how many there are."""

    path: Path
    offset: int
    rows: int
    columns: int


@dataclass(frozen=True, eq=False)
class SampleStore:
    """Samples of a whole population; open it with :meth:`open`.

    Holds no open file, so it may be handed to other processes and threads.

    Attributes:
        path: the store's folder.
        name: of the population.
        population: every shape in the store, held-out rows included.
        frame: millimetres to model units.
        alignment: scanner millimetres to the atlas frame.
        source: how the data were made; empty for a user's own.
        options: sample counts, split and seed that the store was prepared with.
        folders: one folder name a row.
        blocks: sample files by row and kind, filled on first use.
    """

    path: Path
    name: str
    population: Population
    frame: Frame
    alignment: Alignment
    source: dict[str, Any]
    options: dict[str, Any]
    folders: tuple[str, ...]
    blocks: dict[tuple[int, str], _Block]

    @classmethod
    def open(cls, path: str | Path) -> SampleStore:
        """Open a prepared store; reads the index alone.

        Raises:
            InputError: when ``path`` is not a finished store, is damaged, or a newer program wrote it.
        """
        path = Path(path)
        record = _read_index(path / INDEX)
        try:
            store = cls(
                path=path,
                name=records.entry(record, "name", str),
                population=Population.from_json(records.entry(record, "population", dict)),
                frame=Frame.from_json(records.entry(record, "frame", dict)),
                alignment=Alignment.from_json(records.entry(record, "alignment", dict)),
                source=records.scalars(record, "source"),
                options=_options(record),
                folders=_folders(record),
                blocks={},
            )
            if len(store.folders) != len(store.population):
                raise ValueError(f"{len(store.folders)} shapes of {len(store.population)} visits")
        except (TypeError, ValueError) as error:
            raise _damaged(path / INDEX, str(error)) from error
        return store

    def __len__(self) -> int:
        return len(self.folders)

    def folder(self, row: int) -> Path:
        """The folder of one shape."""
        return self.path / SHAPES / self.folders[row]

    def mesh(self, row: int) -> Shape:
        """The repaired and aligned shape of one row, millimetres in the atlas frame.

        Raises:
            InputError: when its file is missing or damaged.
        """
        return _read_shape(self.folder(row), self.frame.dim)

    def draw(
        self, rows: Sequence[int], n_surface: int, n_near: int, n_uniform: int, rng: np.random.Generator
    ) -> Draw:
        """Read a random subset of each row's samples; ``rng`` alone decides which.

        The files are shuffled, so one contiguous block at a random offset is a random subset.

        Raises:
            InputError: when a shape has fewer samples than asked for, or a file is missing or damaged.
        """
        surface = np.stack([self._block(row, "surface", n_surface, rng) for row in rows])
        near = np.stack([self._block(row, "near", n_near, rng) for row in rows])
        uniform = np.stack([self._block(row, "uniform", n_uniform, rng) for row in rows])
        space, dim = np.concatenate([near, uniform], axis=1), self.frame.dim
        return Draw(surface[..., :dim], surface[..., dim:], space[..., :dim], space[..., dim])

    def require_sound(self, row: int, n_surface: int, n_near: int, n_uniform: int) -> None:
        """Read all samples of a row, so that no draw of so many can fail later.

        Raises:
            InputError: as :meth:`draw`.
        """
        for kind, count in zip(KINDS, (n_surface, n_near, n_uniform), strict=True):
            block = self._block_of(row, kind, count)
            if not _are_sound(block):
                raise _damaged(block.path, _NO_SAMPLES)

    def _block_of(self, row: int, kind: str, count: int) -> _Block:
        """Where at least so many samples lie."""
        block = self.blocks.get((row, kind)) or self._open_block(row, kind)
        if count > block.rows:
            raise InputError(
                f"{count} {kind} samples were asked for but the store has {block.rows} a shape; "
                f"prepare it again with more"
            )
        return block

    def _block(self, row: int, kind: str, count: int, rng: np.random.Generator) -> NDArray[np.float32]:
        # Plain reads instead of lasting memory maps: a map a file would exhaust the usual limit of
        # 1024 open files at a few hundred shapes, and a read of a cached block costs about as little.
        block = self._block_of(row, kind, count)
        start = int(rng.integers(0, block.rows - count + 1))
        offset = block.offset + start * block.columns * 4
        try:
            flat = np.fromfile(block.path, np.float32, count * block.columns, offset=offset)
            drawn = flat.reshape(count, block.columns)
        except (OSError, ValueError) as error:
            raise _damaged(block.path, "it is cut off or cannot be read") from error
        if not (np.abs(drawn) <= FARTHEST).all():
            raise _damaged(block.path, _NO_SAMPLES)
        return drawn

    def _open_block(self, row: int, kind: str) -> _Block:
        block = _find_block(self.folder(row) / f"{kind}.npy", kind, self.frame.dim)
        if block.rows != (expected := self.options.get(f"{kind}_samples", block.rows)):
            raise _damaged(block.path, f"{block.rows} samples where {expected} are expected")
        self.blocks[row, kind] = block
        return block


def _find_block(path: Path, kind: str, dim: int) -> _Block:
    try:
        array = np.lib.format.open_memmap(path, mode="r")
    except OSError as error:
        raise _damaged(path, (error.strerror or "it cannot be read").lower()) from error
    except Exception as error:  # numpy and Python's own parser raise whatever they like on damaged headers
        raise _damaged(path, "it is cut off, or its header is not that of samples") from error
    expected = 2 * dim if kind == "surface" else dim + 1
    if array.ndim != 2:
        raise _damaged(path, f"it has {array.ndim} dimensions in place of rows and columns")
    if array.dtype != np.float32 or array.shape[1] != expected or not array.flags.c_contiguous:
        raise _damaged(path, f"{array.dtype} in {array.shape[1]} columns")
    return _Block(path, int(array.offset), *map(int, array.shape))


def _read_shape(folder: Path, dim: int) -> Shape:
    kind = SHAPE_KINDS[dim]
    path = folder / kind.stored
    try:
        return kind.read(path.read_bytes())
    except Exception as error:  # the reader raises whatever it likes on damaged files
        raise _damaged(path, str(error)) from error


def is_whole(folder: Path, counts: Mapping[str, int], dim: int) -> bool:
    """Whether a shape's folder holds its shape and so many samples of each kind, in ``dim`` dimensions."""
    try:
        blocks = {kind: _find_block(folder / f"{kind}.npy", kind, dim) for kind in counts}
        _read_shape(folder, dim)
    except InputError:
        return False
    return all(blocks[kind].rows == count and _are_sound(blocks[kind]) for kind, count in counts.items())


def _are_sound(block: _Block) -> bool:
    """Whether all samples of a file are numbers that can be of a shape in the box."""
    samples = np.fromfile(block.path, np.float32, block.rows * block.columns, offset=block.offset)
    return len(samples) == block.rows * block.columns and bool((np.abs(samples) <= FARTHEST).all())


def _damaged(path: Path, what: str) -> InputError:
    return InputError(f"{path} is damaged ({what}); run 'naisr prepare' again")


def _read_index(path: Path) -> dict[str, Any]:
    if not path.is_file():
        raise InputError(f"{path.parent} is not a finished sample store; run 'naisr prepare' first")
    try:
        record = records.parsed(path.read_text(encoding="utf-8"))
        version = records.entry(record, "version", int)
    except (OSError, ValueError) as error:
        raise _damaged(path, str(error)) from error
    if version > VERSION:
        raise InputError(f"{path} was written by a newer version of this program; update the program")
    if version < 1:
        raise _damaged(path, f"it is of the unknown version {version}")
    return record


def _options(record: dict[str, Any]) -> dict[str, Any]:
    """Settings of the preparation, counts of samples among them."""
    options = records.scalars(record, "options")
    for kind in KINDS:
        if f"{kind}_samples" in options and records.entry(options, f"{kind}_samples", int) < 1:
            raise ValueError(f"'{kind}_samples' is below 1")
    return options


def _folders(record: dict[str, Any]) -> tuple[str, ...]:
    """Names of the shapes' folders, which lie in the store."""
    names = records.texts(record, "shapes")
    if strangers := [name for name in names if Path(name).name != name or name in ("", ".", "..")]:
        raise ValueError(f"the folder '{strangers[0][:60]}' of a shape is none of the store")
    return names


def write_index(
    path: Path,
    *,
    name: str,
    population: Population,
    frame: Frame,
    alignment: Alignment,
    source: dict[str, Any],
    options: dict[str, Any],
    folders: Sequence[str],
) -> None:
    """Write ``store.json`` atomically; a store exists from this moment on."""
    record = {
        "version": VERSION,
        "name": name,
        "population": population.to_json(),
        "frame": frame.to_json(),
        "alignment": alignment.to_json(),
        "source": source,
        "options": options,
        "shapes": list(folders),
    }
    with replacing(path / INDEX) as temporary:
        temporary.write_text(json.dumps(record, indent=1), encoding="utf-8")
