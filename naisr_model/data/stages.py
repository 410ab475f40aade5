"""What is done for each row of a table on its way into a store: look at it, place it, sample it.

Each stage is one function of one row, so that rows go over processes; what it gives says what went wrong,
where something did, and never stops the others.
"""

from __future__ import annotations

import hashlib
import io
from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh
from numpy.typing import NDArray

from naisr_model.data import align, meshes, samples, store
from naisr_model.data.align import Alignment
from naisr_model.data.tables import TableRow
from naisr_model.errors import InputError
from naisr_model.files import replacing_folder
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
    mesh = meshes.repair_mesh(meshes.read_mesh(path))
    return mesh, meshes.check_mesh(mesh)


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
    """Sample one shape into its folder; false when the folder is already there.

    Raises:
        InputError: when the mesh cannot be used any more, or the folder cannot be written.
    """
    if store.is_whole(job.target, dict(zip(store.KINDS, job.counts, strict=True)), job.frame.dim):
        return False
    mesh, _ = load(job.mesh)
    mesh.apply_transform(np.array(job.transform))
    taken = samples.sample_shape(mesh, job.frame, *job.counts, job.seed)
    with replacing_folder(job.target) as temporary:
        for kind in store.KINDS:
            (temporary / f"{kind}.npy").write_bytes(_npy(getattr(taken, kind)))
        with (temporary / store.MESH).open("wb") as file:
            mesh.export(file, file_type="ply")
    return True


def _npy(array: NDArray[np.float32]) -> bytes:
    """The contents of a .npy file; NumPy would not say what keeps it from being written."""
    content = io.BytesIO()
    np.save(content, array)
    return content.getvalue()
