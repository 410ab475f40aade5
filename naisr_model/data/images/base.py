"""What every reader of images shares: the image, its bytes, and one judgement of its axes."""

from __future__ import annotations

import bz2
import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from naisr_model.data.remarks import Remark
from naisr_model.errors import InputError
from naisr_model.files import why_unreadable

MOST_BYTES = 1 << 30
"""Of voxels as the file stores them; as whole numbers and as a surface they take a few times as much."""

MOST_SHIFT = 0.1
"""Voxels: how far straightening its axes may move one, and two matrices that say the same may differ."""

DIRECTION_DECIMALS = 3
"""Directions are written with no fewer."""

MOST_ROUNDING = 4e-3
"""As :func:`_rounding` has it: however few decimals there are, half a degree of shear is none."""

_DECIMALS = 8
_SINGLE = 2.0**-23
_BEYOND = 1e12
_BLOCK = 1 << 20
_HEADROOM = 1 << 24
_GZIP = b"\x1f\x8b"


@dataclass(frozen=True, eq=False)
class Image:
    """A file's voxels and where they lie.

    Attributes:
        voxels: as stored, ``[layers, i, j, k]``; nearly all files have one layer.
        slope: what is meant is ``slope * voxels + intercept``.
        intercept: see ``slope``.
        unit_mm: millimetres in the unit of length that the file states; None where it states none.
        to_lps_mm: 4x4, voxel indices ``(i, j, k, 1)`` of voxel centres to LPS millimetres; the axes are
            orthogonal.
        metadata: what else the file says, by key.
        remarks: what is odd about the file.
    """

    voxels: NDArray[Any]
    to_lps_mm: NDArray[np.float64]
    metadata: Mapping[str, str]
    remarks: tuple[Remark, ...]
    slope: float = 1.0
    intercept: float = 0.0
    unit_mm: float | None = None


# --- bytes --------------------------------------------------------------------------------------


def beginning(path: Path, count: int) -> bytes:
    """The first bytes of a file, unpacked where it is gzipped; fewer where it is shorter or damaged."""
    try:
        with path.open("rb") as file:
            start = file.read(_BLOCK)
    except OSError as error:
        raise InputError(why_unreadable(path, error)) from error
    if not start.startswith(_GZIP):
        return start[:count]
    try:
        return zlib.decompressobj(wbits=31).decompress(start, count)
    except zlib.error:
        return b""


def content(path: Path) -> bytes:
    """A whole file, unpacked where it is gzipped.

    Raises:
        InputError: when it cannot be read, or a gzip stream is damaged or cut off.
    """
    try:
        with path.open("rb") as file:
            packed = file.read(2) == _GZIP
            file.seek(0)
            most = MOST_BYTES + _HEADROOM
            return unpacked(path.name, file, "gzip", most) if packed else file.read(most)
    except OSError as error:
        raise InputError(why_unreadable(path, error)) from error


def stored(path: Path) -> bytes:
    """A whole file of voxels as it is on the disk."""
    try:
        with path.open("rb") as file:
            return file.read(MOST_BYTES + _HEADROOM)
    except OSError as error:
        raise InputError(why_unreadable(path, error)) from error


def beside(path: Path, told: str) -> Path:
    """The file that a header says its voxels are in; where it lies is told relative to the header.

    Raises:
        InputError: when there is none, or there are several.
    """
    if "%" in told or told.split()[:1] in (["LIST"], ["list"]):
        raise InputError(f"{path.name} has its voxels in several files ({told}); save them as one")
    if not (apart := path.parent / told).is_file():
        raise InputError(
            f"{path.name} has its voxels in {told}, which is not there; keep both files together"
        )
    return apart


def decoded(header: bytes) -> str:
    """The text of a header."""
    try:
        return header.decode("utf-8")
    except UnicodeDecodeError:
        return header.decode("latin-1")


def unpacked(name: str, file: BinaryIO, encoding: str, most: int) -> bytes:
    """Up to ``most`` bytes of gzip, zlib or bzip2 streams one after another; what follows is left out.

    Raises:
        InputError: when a stream is damaged or cut off.
    """
    found, packed = bytearray(), file.read(_BLOCK)
    magic = packed[:2]
    try:
        while packed[:2] == magic and len(found) < most:
            packed = _stream(name, file, packed, encoding, found, most)
    except (zlib.error, OSError) as error:
        raise InputError(f"{name} is damaged ({error}); copy or export it again") from error
    return bytes(found)


def _stream(name: str, file: BinaryIO, packed: bytes, encoding: str, found: bytearray, most: int) -> bytes:
    """Unpack one stream; returns what follows it, as much as was read."""
    unpacker: Any = bz2.BZ2Decompressor() if encoding == "bzip2" else zlib.decompressobj(wbits=47)
    while not unpacker.eof and len(found) < most:
        found += unpacker.decompress(packed, min(_BLOCK, most - len(found)))
        rest = getattr(unpacker, "unconsumed_tail", b"")  # bzip2 keeps its own
        wants = not rest and getattr(unpacker, "needs_input", True)
        packed = file.read(_BLOCK) if wants and not unpacker.eof else rest
        if wants and not packed and not unpacker.eof:
            raise InputError(f"{name} is cut off; copy or export it again")
    return unpacker.unused_data + file.read(2 if len(unpacker.unused_data) < 2 else 0)


def require_size(name: str, counts: Sequence[int], itemsize: int) -> None:
    """Refuse what no segmentation announces, before memory is taken for it.

    Args:
        name: of the file.
        counts: voxels along every axis.
        itemsize: bytes a voxel.
    """
    size = " x ".join(map(str, counts))
    if min(counts, default=0) < 1:
        raise InputError(f"{name} announces {size} voxels; it is damaged, export it again")
    if math.prod(counts) * itemsize > MOST_BYTES:
        raise InputError(
            f"{name} announces {size} voxels, more than {MOST_BYTES >> 20:,} MB; crop it around the shape"
        )


def require_volume(name: str, counts: Sequence[int]) -> None:
    """Refuse an image without extent along one of three axes."""
    if len(counts) < 3 or min(counts[:3]) < 2:
        size = " x ".join(map(str, counts))
        raise InputError(f"{name} is a two-dimensional image ({size}); give the whole volume")


def require_one_value(name: str, count: int) -> None:
    """Refuse colours, vectors and series in time."""
    if count != 1:
        raise InputError(f"{name} holds {count} values a voxel; save one label volume alone")


def cut_off(name: str, announced: int, found: int) -> InputError:
    """A file with fewer bytes of voxels than its header announces."""
    sentence = f"{name} is cut off: it announces {announced:,} bytes of voxels and has {max(found, 0):,}"
    return InputError(f"{sentence}; copy or export it again")


# --- axes ---------------------------------------------------------------------------------------


def squared(
    name: str, to_lps_mm: NDArray[np.float64], matrix: NDArray[np.float64], counts: Sequence[int]
) -> tuple[NDArray[np.float64], tuple[Remark, ...]]:
    """Voxel indices to LPS millimetres with axes at right angles, the middle of the image where it was.

    Headers round directions; the nearest orthogonal axes (polar decomposition) are what was meant, unless
    they move a voxel by more than :data:`MOST_SHIFT` and by more than rounding explains.

    Args:
        name: of the file.
        to_lps_mm: 4x4, the file's world and unit to LPS millimetres.
        matrix: 4x4, voxel indices to the file's world.
        counts: voxels along each index axis.

    Returns:
        The matrix, 4x4, and a remark where rounding moves a voxel by more than that.

    Raises:
        InputError: when a number is not finite, an axis has no length or the axes are sheared.
    """
    if not (np.abs(matrix) < _BEYOND).all():  # nor NaN
        raise InputError(f"{name} has axes that are not finite numbers; export it again")
    written, matrix = matrix[:3, :3], to_lps_mm @ matrix
    steps = np.linalg.norm(matrix[:3, :3], axis=0)
    if (steps < 1 / _BEYOND).any():
        raise unspaced(name, steps)
    directions = matrix[:3, :3] / steps
    left, _, right = np.linalg.svd(directions)
    straight, middle = matrix.copy(), (np.array(counts) - 1) / 2
    straight[:3, :3] = left @ right * steps
    straight[:3, 3] += (matrix - straight)[:3, :3] @ middle
    if shift(straight, matrix, counts) <= MOST_SHIFT:
        return straight, ()
    if np.linalg.norm(directions - left @ right) > _rounding(written):
        raise InputError(f"the axes of {name} are not at right angles; resample it onto a rectangular grid")
    most_mm = np.linalg.norm(apart(straight, matrix, counts), axis=0).max()
    sentence = (
        f"the file gives its axes rounded: they were straightened, which moves corners by {most_mm:.2g} mm"
    )
    return straight, (Remark("fine", "axes", sentence),)


def _rounding(written: NDArray[np.float64]) -> float:
    """How far rounded axes may be from being orthogonal, as the Frobenius norm of unit vectors.

    What rounding by E adds to a rotation R is R sym(R'E) beside a turn, which is no longer than E, whose
    entries are at most half a unit of the last decimal. What was rounded are the directions, or their
    products with the spacing.

    Args:
        written: the axes in columns as the file has them, ``[3, 3]``.
    """
    unit = 10.0 ** -_decimals(written)
    products = unit / 2 * float(np.sqrt((3 / np.square(written).sum(axis=0)).sum()))
    return max(1.5 * 10.0**-DIRECTION_DECIMALS, min(products, MOST_ROUNDING))


def _decimals(numbers: NDArray[np.float64]) -> int:
    """With how many decimals numbers are written, which may have gone through single precision."""
    for decimals in range(_DECIMALS):
        if (np.abs(numbers - numbers.round(decimals)) <= _SINGLE * np.abs(numbers)).all():
            return decimals
    return _DECIMALS


def unspaced(name: str, steps: NDArray[np.floating]) -> InputError:
    """Of voxels whose size is no length."""
    size = " x ".join(f"{step:g}" for step in steps)
    return InputError(f"{name} has voxels of {size} mm; set the spacing and export it again")


def shift(one: NDArray[np.float64], other: NDArray[np.float64], counts: Sequence[int]) -> float:
    """By how many voxels of ``one``, which is invertible, two matrices place a corner of the image apart."""
    return float(np.abs(np.linalg.inv(one)[:3, :3] @ apart(one, other, counts)).max())


def apart(one: NDArray[np.float64], other: NDArray[np.float64], counts: Sequence[int]) -> NDArray[np.float64]:
    """From where one matrix places the corners of the image to where another does, ``[3, 8]``."""
    ends = [[0, count - 1] for count in counts]
    corners = np.stack(np.meshgrid(*ends, [1], indexing="ij"), axis=-1).reshape(-1, 4)
    return ((other - one) @ corners.T)[:3]


def surplus(count: int) -> tuple[Remark, ...]:
    """For a file with more bytes than it announces, which may be what is left of a size that is wrong."""
    if count <= 0:
        return ()
    sentence = f"the file holds {count:,} bytes or more beyond the voxels that it announces"
    return (Remark("look", "surplus", sentence, "compare the volume with the one you expect"),)


def unplaced() -> Remark:
    """For a file that does not name its axes."""
    return Remark(
        "look",
        "orientation",
        "the file does not say how the patient lies",
        "do not rely on left and right",
    )


def unlocated() -> Remark:
    """For a file that names no origin."""
    sentence = "the file does not say where the image lies, so its first voxel is taken to be at 0"
    return Remark("look", "origin", sentence, "align it to the atlas")
