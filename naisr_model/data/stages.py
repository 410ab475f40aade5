"""What is done for each row of a table on its way into a store: look at it, place it, sample it.

Each stage is one function of one row, so that rows go over processes; what it gives says what went wrong,
where something did, and never stops the others.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from naisr_model.data import align, samples, store
from naisr_model.data.align import Alignment
from naisr_model.data.comparison import Bulk, measured
from naisr_model.data.remarks import Remark
from naisr_model.data.sound import sound_shape
from naisr_model.data.tables import TableRow, require_file
from naisr_model.errors import InputError
from naisr_model.files import replacing_folder, sha256_of
from naisr_model.frames import Frame
from naisr_model.shapes.kinds import kind_of


class Look(NamedTuple):
    """What the first look at one row gives; one of the remarks refuses a row that cannot be used."""

    remarks: tuple[Remark, ...]
    digest: str = ""
    space: str = ""
    bulk: Bulk | None = None
    landmarks: align.Landmarks | None = None


class Placed(NamedTuple):
    """One row in the atlas frame: scanner to atlas, and its bounds there in millimetres."""

    remarks: tuple[Remark, ...]
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


def inspect(job: tuple[TableRow, str]) -> Look:
    """The first look at a row, which is aligned by a method."""
    row, method = job
    try:
        require_file(row.mesh)
        file = sound_shape(row.mesh)
        if kind_of(file.shape_mm).dim == 2 and method != "none":
            raise InputError(f'{row.mesh.name} is a curve, taken as it lies; set method = "none" in the TOML')
        landmarks = None
        if method == "landmarks":
            if row.landmarks is None:
                raise InputError("the row has no landmarks file; alignment by landmarks needs one")
            require_file(row.landmarks)
            landmarks = align.read_landmarks(row.landmarks, file.space or "LPS")
        digest = sha256_of(row.mesh)
        return Look(file.remarks, digest, file.space, measured(file.shape_mm), landmarks)
    except InputError as error:
        return Look((Remark("refuse", "file", str(error)),))
    except Exception as error:  # one damaged mesh never stops the others, whatever is wrong with it
        sentence = f"{row.mesh.name} cannot be used ({error!r})"
        return Look((Remark("refuse", "file", sentence, "export it again"),))


def place(job: tuple[Alignment, Path, align.Landmarks | None]) -> Placed:
    """Where the mesh of a row that was looked at lies once it is aligned."""
    alignment, path, landmarks = job
    try:
        mesh = sound_shape(path).shape_mm
        transform = align.rigid_transform(alignment, mesh, landmarks)
    except InputError as error:
        return Placed((Remark("refuse", "alignment", str(error)),))
    mesh.apply_transform(transform)
    return Placed((), _nested(transform), _nested(mesh.bounds))


def _nested(array: NDArray[np.float64]) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(map(float, line)) for line in array)


def write_samples(job: Sampling) -> bool:
    """Sample one shape into its folder; false when the folder is already there.

    Raises:
        InputError: when the mesh cannot be used any more, or the folder cannot be written.
    """
    if store.is_whole(job.target, dict(zip(store.KINDS, job.counts, strict=True)), job.frame.dim):
        return False
    mesh = sound_shape(job.mesh).shape_mm
    mesh.apply_transform(np.array(job.transform))
    taken = samples.sample_shape(mesh, job.frame, *job.counts, job.seed)
    with replacing_folder(job.target) as temporary:
        for name in store.KINDS:
            (temporary / f"{name}.npy").write_bytes(_npy(getattr(taken, name)))
        kind = kind_of(mesh)
        (temporary / kind.stored).write_bytes(kind.written(mesh))
    return True


def _npy(array: NDArray[np.float32]) -> bytes:
    """The contents of a .npy file; NumPy would not say what keeps it from being written."""
    content = io.BytesIO()
    np.save(content, array)
    return content.getvalue()
