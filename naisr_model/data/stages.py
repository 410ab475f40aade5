"""What is done for each row of a table on its way into a store: look at it, place it, sample it.

Each stage is one function of one row, so that rows go over processes; what it gives says what went wrong,
where something did, and never stops the others.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh
from numpy.typing import NDArray

from naisr_model.data import align, meshes, samples, store
from naisr_model.data.align import Alignment
from naisr_model.data.tables import TableRow
from naisr_model.errors import InputError
from naisr_model.frames import Frame


class Look(NamedTuple):
    """What the first look at one row gives; ``reason`` is empty for a usable row."""

    reason: str = ""
    warnings: tuple[str, ...] = ()
    digest: str = ""
    volume_mm3: float = 0.0
    landmarks: align.Landmarks | None = None


class Placed(NamedTuple):
    """One row in the atlas frame: scanner to atlas, and its bounds there in millimetres."""

    reason: str
    transform: tuple[tuple[float, ...], ...] = ()
    bounds_mm: tuple[tuple[float, ...], ...] = ()


class Sampling(NamedTuple):
    """Everything needed to write the samples of one shape: ``counts`` of each of the store's kinds."""

    mesh: Path
    transform: tuple[tuple[float, ...], ...]
    frame: Frame
    counts: tuple[int, int, int]
    seed: int
    target: Path


def load(path: Path) -> tuple[trimesh.Trimesh, tuple[str, ...]]:
    """A mesh with what can be repaired repaired, and what is odd about it.

    Raises:
        InputError: when it cannot be used.
    """
    file = meshes.sound_mesh(path)
    return file.mesh_mm, tuple(remark.text for remark in file.remarks)


def inspect(job: tuple[TableRow, str]) -> Look:
    """The first look at a row, which is aligned by a method."""
    row, method = job
    try:
        mesh, warnings = load(row.mesh)
        landmarks = None
        if method == "landmarks":
            if row.landmarks is None:
                raise InputError("the row has no landmarks file; alignment by landmarks needs one")
            landmarks = align.read_landmarks(row.landmarks)
        digest = hashlib.sha256(row.mesh.read_bytes()).hexdigest()
    except InputError as error:
        return Look(reason=str(error))
    except Exception as error:  # one damaged mesh never stops the others, whatever is wrong with it
        return Look(reason=f"{row.mesh.name} cannot be used ({error!r}); export it again")
    return Look("", warnings, digest, float(mesh.volume), landmarks)


def place(job: tuple[Alignment, Path, Look]) -> Placed:
    """Where the mesh of a row that was looked at lies once it is aligned."""
    alignment, path, item = job
    if item.reason:
        return Placed(item.reason)
    try:
        mesh, _ = load(path)
        transform = align.rigid_transform(alignment, mesh, item.landmarks)
    except InputError as error:
        return Placed(str(error))
    mesh.apply_transform(transform)
    return Placed("", _nested(transform), _nested(mesh.bounds))


def _nested(array: NDArray[np.float64]) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(map(float, line)) for line in array)


def write_samples(job: Sampling) -> bool:
    """Sample one shape into its folder; false when the folder is already there."""
    if store.is_whole(job.target, dict(zip(store.KINDS, job.counts, strict=True)), job.frame.dim):
        return False
    shutil.rmtree(job.target, ignore_errors=True)
    mesh, _ = load(job.mesh)
    mesh.apply_transform(np.array(job.transform))
    taken = samples.sample_shape(mesh, job.frame, *job.counts, job.seed)
    temporary = job.target.with_name(f".{job.target.name}.{os.getpid()}.tmp")
    shutil.rmtree(temporary, ignore_errors=True)
    temporary.mkdir()
    for kind in store.KINDS:
        np.save(temporary / f"{kind}.npy", getattr(taken, kind))
    mesh.export(temporary / store.MESH)
    try:
        temporary.rename(job.target)
    except OSError:  # another process was faster with the same content
        shutil.rmtree(temporary)
        return False
    return True
