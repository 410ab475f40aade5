"""MetaImage, as ITK writes it: ``.mha`` with its voxels inside, ``.mhd`` with its voxels beside it."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from naisr_model.data.images.base import (
    Image,
    beside,
    cut_off,
    decoded,
    require_one_value,
    require_size,
    require_volume,
    squared,
    stored,
    surplus,
    unlocated,
    unpacked,
    unplaced,
    unspaced,
)
from naisr_model.data.remarks import Remark
from naisr_model.errors import InputError

_WORDS = {"CHAR": "1", "SHORT": "2", "INT": "4", "LONG": "4", "LONG_LONG": "8"}
TYPES = {
    "MET_FLOAT": "f4",
    "MET_DOUBLE": "f8",
    **{f"MET_{word}": f"i{size}" for word, size in _WORDS.items()},
    **{f"MET_U{word}": f"u{size}" for word, size in _WORDS.items()},
}
"""What numpy calls the types of voxels."""

UNITS_MM = {"um": 1e-3, "mm": 1.0, "cm": 10.0}
"""Other units, as ?, are none: millimetres, then."""

SPACINGS = ("ElementSpacing", "ElementSize")
DIRECTIONS = ("TransformMatrix", "Rotation", "Orientation")
ORIGINS = ("Offset", "Position", "Origin")
"""Fields by all their names, the usual one first."""

UNIT_LENGTH = 0.01
"""By how much the length of a direction, which is rounded, may differ from 1."""

_HEADER_BYTES = 1 << 20
_LAST = re.compile(rb"^[ \t]*ElementDataFile[ \t]*[=:][^\r\n]*(\r?\n|\Z)", re.MULTILINE)
_LINE = re.compile(r"\s*(\w+)\s*[=:]\s*(.*?)\s*")


def read_metaimage(path: Path, content: bytes) -> Image:
    """Read a MetaImage, whose world is LPS.

    Args:
        path: of the header; voxels kept apart lie relative to it.
        content: the whole file, unpacked.

    Raises:
        InputError: when the file is damaged or cut off, or is no single volume of numbers.
    """
    end = _LAST.search(content, 0, _HEADER_BYTES)
    if end is None:
        raise InputError(f"{path.name} does not say where its voxels are; it is damaged, export it again")
    fields = _fields(decoded(content[: end.end()]))
    counts, dtype = _counts(path.name, fields), _dtype(path.name, fields)
    require_size(path.name, counts, dtype.itemsize)
    channels = _numbers(path.name, fields, ("ElementNumberOfChannels",), 1)
    require_one_value(path.name, math.prod(counts[3:]) * (1 if channels is None else int(channels[0])))
    require_volume(path.name, counts)
    matrix, placed = _matrix(path.name, fields, len(counts))
    voxels, left = _voxels(path, fields, counts[:3], dtype, content[end.end() :])
    unit_mm = UNITS_MM.get(fields.get("DistanceUnits", "").lower())
    in_mm = np.diag([*[unit_mm or 1.0] * 3, 1.0])
    lps_mm, squared_remarks = squared(path.name, in_mm, matrix, counts[:3])
    return Image(voxels[None], lps_mm, fields, (*placed, *squared_remarks, *surplus(left)), unit_mm=unit_mm)


# --- header -------------------------------------------------------------------------------------


def _fields(header: str) -> dict[str, str]:
    lines = map(_LINE.fullmatch, header.splitlines())
    return {line[1]: line[2] for line in lines if line}


def _numbers(
    name: str, fields: Mapping[str, str], names: Sequence[str], count: int
) -> NDArray[np.float64] | None:
    """The numbers of a field by the first of its names that is there; None where none is."""
    field = next((each for each in names if each in fields), None)
    if field is None:
        return None
    try:
        numbers = np.array(fields[field].split(), np.float64)
    except ValueError:
        numbers = np.zeros(0)
    if len(numbers) != count or not np.isfinite(numbers).all():
        wanted = f"{count} numbers" if count > 1 else "number"
        line = f"{field} = {fields[field]}"[:60]
        raise InputError(f"{name} has a damaged header: {line!r} gives no {wanted}; export it again")
    return numbers


def _counts(name: str, fields: Mapping[str, str]) -> list[int]:
    if (kind := fields.get("ObjectType", "Image")).lower() != "image":
        raise InputError(f"{name} holds no image but a '{kind[:40]}'; save the label volume itself")
    if not re.fullmatch(r"[1-9]", fields.get("NDims", "")) or "DimSize" not in fields:
        raise InputError(f"{name} does not say how many voxels it has; it is damaged, export it again")
    sizes = _numbers(name, fields, ("DimSize",), int(fields["NDims"]))
    assert sizes is not None
    return [int(size) for size in sizes]


def _dtype(name: str, fields: Mapping[str, str]) -> np.dtype:
    told = fields.get("ElementType", "")
    if (kind := TYPES.get(told.upper().removesuffix("_ARRAY"))) is None:
        raise InputError(f"{name} has voxels of the unknown type '{told[:40]}'; export it again")
    is_big = _is_true(fields, "BinaryDataByteOrderMSB") or _is_true(fields, "ElementByteOrderMSB")
    return np.dtype(f"{'>' if is_big else '<'}{kind}")


def _is_true(fields: Mapping[str, str], field: str) -> bool:
    return fields.get(field, "").lower() in ("true", "t", "1")


def _matrix(
    name: str, fields: Mapping[str, str], dimensions: int
) -> tuple[NDArray[np.float64], tuple[Remark, ...]]:
    """Voxel indices to LPS in the file's unit, 4x4: each row of directions is that of an axis."""
    steps = _numbers(name, fields, SPACINGS, dimensions)
    directions = _numbers(name, fields, DIRECTIONS, dimensions**2)
    origin = _numbers(name, fields, ORIGINS, dimensions)
    if steps is None:
        raise InputError(f"{name} does not say how large its voxels are; set the spacing and export it again")
    if (steps[:3] <= 0).any():
        raise unspaced(name, steps[:3])
    matrix = np.eye(4)
    matrix[:3, :3] = _axes(name, directions, dimensions) * steps[:3]
    matrix[:3, 3] = 0 if origin is None else origin[:3]
    unknown = () if directions is not None else (unplaced(),)
    return matrix, unknown if origin is not None else (*unknown, unlocated())


def _axes(name: str, directions: NDArray[np.float64] | None, dimensions: int) -> NDArray[np.float64]:
    """Unit vectors in columns, ``[3, 3]``: rounded ones would make the voxels larger or smaller."""
    if directions is None:
        return np.eye(3)
    axes = directions.reshape(dimensions, dimensions)[:3, :3].T
    lengths = np.linalg.norm(axes, axis=0)
    if (np.abs(lengths - 1) > UNIT_LENGTH).any():
        told = ", ".join(f"{length:.3g}" for length in lengths)
        raise InputError(f"{name} has axes of the lengths {told} where 1 is meant; export it again")
    return np.asarray(axes / lengths)


# --- voxels -------------------------------------------------------------------------------------


def _voxels(
    path: Path, fields: Mapping[str, str], counts: Sequence[int], dtype: np.dtype, rest: bytes
) -> tuple[NDArray[Any], int]:
    """The voxels, and how many bytes follow them."""
    if fields.get("BinaryData", "True").lower() in ("false", "f", "0"):
        raise InputError(f"{path.name} writes its voxels as text; save it as binary")
    name, first, data = _apart(path, fields, rest)
    size = math.prod(counts) * dtype.itemsize
    if _is_true(fields, "CompressedData"):
        data = unpacked(name, io.BytesIO(data[max(first, 0) :]), "zlib", size + 1)
        first = 0
    first = len(data) - size if first < 0 else first
    left = len(data) - first - size
    if first < 0 or left < 0:
        raise cut_off(name, size, len(data) - max(first, 0))
    return np.frombuffer(data, dtype, math.prod(counts), first).reshape(counts, order="F"), left


def _apart(path: Path, fields: Mapping[str, str], rest: bytes) -> tuple[str, int, bytes]:
    """Name and bytes of the file that holds the voxels, and where they begin; -1 for at its end."""
    told = fields.get("ElementDataFile", "")
    if told.upper() == "LOCAL":
        return path.name, 0, rest
    if not told:
        raise InputError(f"{path.name} does not say where its voxels are; it is damaged, export it again")
    skipped = _numbers(path.name, fields, ("HeaderSize",), 1)
    first = 0 if skipped is None else int(skipped[0])
    apart = beside(path, told)
    return apart.name, max(first, -1), stored(apart)
