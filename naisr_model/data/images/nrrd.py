"""NRRD, with its voxels in the file or beside it: header fields parsed by pynrrd, judged here."""

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
    MOST_BYTES,
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
)
from naisr_model.data.remarks import Remark
from naisr_model.errors import InputError

SIGNS_TO_LPS = {
    "left-posterior-superior": (1, 1, 1),
    "lps": (1, 1, 1),
    "right-anterior-superior": (-1, -1, 1),
    "ras": (-1, -1, 1),
    "left-anterior-superior": (1, -1, 1),
    "las": (1, -1, 1),
}
UNITS_MM = {
    "": 1.0,
    "mm": 1.0,
    "millimeter": 1.0,
    "millimetre": 1.0,
    "cm": 10.0,
    "centimeter": 10.0,
    "centimetre": 10.0,
    "m": 1000.0,
    "meter": 1000.0,
    "metre": 1000.0,
    "um": 1e-3,
    "µm": 1e-3,
    "μm": 1e-3,
    "micron": 1e-3,
    "micrometer": 1e-3,
    "micrometre": 1e-3,
    "nm": 1e-6,
    "nanometer": 1e-6,
    "nanometre": 1e-6,
    "in": 25.4,
    "inch": 25.4,
    "inches": 25.4,
}
ENCODINGS = {"raw": "raw", "gz": "gzip", "gzip": "gzip", "bz2": "bzip2", "bzip2": "bzip2"} | dict.fromkeys(
    ("txt", "text", "ascii"), "text"
)
FIELDS = {
    *("dimension", "type", "encoding", "endian", "sizes", "spacings", "units", "space", "space units"),
    *("space directions", "space origin", "data file", "line skip", "byte skip", "space dimension"),
}
"""What matters; what other fields hold cannot stop a file from being read."""

NUMBERS = {
    *("dimension", "sizes", "spacings", "space dimension", "space directions", "space origin"),
    *("line skip", "byte skip"),
}
"""Those of them that hold numbers."""

MOST_NUMBERS = 1 << 24
"""Of voxels that are written as text, each of which takes a hundred bytes while it is parsed."""

_HEADER_BYTES = 1 << 24
_END = re.compile(rb"\r?\n\r?\n")
_DAMAGED = (ValueError, KeyError, IndexError, TypeError, OverflowError)


def read_nrrd(path: Path, content: bytes) -> Image:
    """Read an NRRD file.

    Args:
        path: of the file; voxels kept apart lie relative to it.
        content: the whole file, unpacked.

    Raises:
        InputError: when the file is damaged or cut off, or is no single volume of numbers.
    """
    end = _END.search(content, 0, _HEADER_BYTES)
    text, data = (content[: end.start()], content[end.end() :]) if end else (content[:_HEADER_BYTES], b"")
    header, metadata = _header(path.name, text)
    counts = _counts(path.name, header)
    _require_encoding(path.name, header)
    directions, is_placed = _directions(path.name, header, len(counts))
    spatial = [axis for axis, direction in enumerate(directions) if not np.isnan(direction).all()]
    _require_axes(path.name, counts, spatial, is_layered=_is_layered(metadata))
    voxels, left = _voxels(path, header, counts, data)
    layers = [axis for axis in range(len(counts)) if axis not in spatial]
    size = [counts[axis] for axis in spatial]
    voxels = voxels.transpose(layers + spatial).reshape(-1, *size, order="A")
    matrix = np.eye(4)
    matrix[:3, :3] = directions[spatial].T
    matrix[:3, 3], origin_remarks = _origin(header)
    unit_mm = _stated_mm(path.name, header)
    lps_mm, squared_remarks = squared(path.name, _to_lps_mm(header, unit_mm or 1.0), matrix, size)
    unknown = () if is_placed and _word(header, "space") in SIGNS_TO_LPS else (unplaced(),)
    remarks = (*unknown, *origin_remarks, *squared_remarks, *surplus(left))
    return Image(voxels, lps_mm, metadata, remarks, unit_mm=unit_mm)


def _header(name: str, content: bytes) -> tuple[dict[str, Any], dict[str, str]]:
    """The fields that matter, and the key/value pairs."""
    import nrrd

    magic, *lines = re.split(r"\r?\n", decoded(content))
    pairs = [line.split(":=", 1) for line in lines if re.match(r"[^:#]+:=", line)]
    fields = [_field(line) for line in lines if re.match(r"[^:#]+:(?!=)", line)]
    kept = [line for line in fields if line.split(":")[0] in FIELDS]
    try:
        with np.errstate(invalid="ignore"):  # sizes that no integer holds
            header = nrrd.read_header(iter([magic, *kept]))
    except (nrrd.NRRDError, *_DAMAGED) as error:
        raise _misread(name, magic, kept) from error
    return dict(header), {key.strip(): value.strip() for key, value in pairs}


def _misread(name: str, magic: str, fields: Sequence[str]) -> InputError:
    """A header that cannot be parsed: its first line that cannot be parsed alone is the one to blame."""
    wrong = next((line for line in fields if not _is_parsed([magic, line])), "")
    if not wrong or not _is_parsed([magic]):
        return InputError(f"{name} has a damaged header, which begins with {magic[:40]!r}; export it again")
    meant = "numbers" if wrong.split(":")[0] in NUMBERS else "a value of NRRD"
    return InputError(f"{name} has a damaged header: {wrong[:60]!r} gives no {meant}; export it again")


def _is_parsed(lines: Sequence[str]) -> bool:
    import nrrd

    try:
        with np.errstate(invalid="ignore"):
            nrrd.read_header(iter(lines))
    except (nrrd.NRRDError, *_DAMAGED):
        return False
    return True


def _field(line: str) -> str:
    """Spelled as pynrrd expects it: lower-case names, one blank between vectors and none inside them."""
    name, value = line.split(":", 1)
    name = {"datafile": "data file", "lineskip": "line skip", "byteskip": "byte skip"}.get(
        name.strip().lower(), name.strip().lower()
    )
    if "(" in value and name.startswith("space"):
        value = re.sub(r"\)\s*\(", ") (", re.sub(r"\s*([,(])\s*|\s+(?=\))", r"\1", value))
        value = re.sub(r"(?<=\w)\(", " (", value)
    return f"{name}: {value.strip()}"


def _counts(name: str, header: Mapping[str, Any]) -> list[int]:
    counts = [int(count) for count in header.get("sizes", ())]
    if not counts or header.get("dimension") != len(counts):
        raise InputError(f"{name} does not say how many voxels it has; it is damaged, export it again")
    require_size(name, counts, 1)
    return counts


def _require_encoding(name: str, header: Mapping[str, Any]) -> None:
    encoding = _word(header, "encoding")
    if encoding not in ENCODINGS:
        known = ", ".join(sorted(set(ENCODINGS.values())))
        raise InputError(f"{name} is encoded as '{encoding}'; export it as one of {known}")


def _directions(name: str, header: Mapping[str, Any], count: int) -> tuple[NDArray[np.float64], bool]:
    """A row for each axis, NaN where it is none of space; and whether the file names their directions."""
    directions = header.get("space directions")
    if directions is not None:
        rows = np.asarray(directions, np.float64)
        if np.isnan(rows).all():
            raise _unspaced(name)
        if rows.shape != (count, 3):
            raise InputError(f"{name} has axes in a space that is not three-dimensional; export it again")
        return rows, True
    spacings = np.asarray(header.get("spacings", ()), np.float64)
    if len(spacings) != count:
        raise _unspaced(name)
    axes = [axis for axis, spacing in enumerate(spacings) if not math.isnan(spacing)]
    rows = np.full((count, 3), np.nan)
    for place, axis in enumerate(axes[:3]):
        rows[axis] = spacings[axis] * np.eye(3)[place]
    return rows, False


def _unspaced(name: str) -> InputError:
    return InputError(f"{name} does not say how large its voxels are; set the spacing and export it again")


def _is_layered(metadata: Mapping[str, str]) -> bool:
    """Whether it is a segmentation of 3D Slicer, whose segments may overlap and then lie in layers."""
    return any(re.fullmatch(r"Segment\d+_(Layer|Name)", key) for key in metadata)


def _require_axes(name: str, counts: Sequence[int], spatial: Sequence[int], *, is_layered: bool) -> None:
    others = [count for axis, count in enumerate(counts) if axis not in spatial]
    if len(counts) < 3 or (len(counts) == 3 and len(spatial) == 2):
        require_volume(name, [counts[axis] for axis in spatial] or counts)
    if len(spatial) > 3:
        raise InputError(f"{name} has {len(spatial)} axes in space; save one label volume alone")
    if len(spatial) < 3:
        raise _unspaced(name)
    if not is_layered:
        require_one_value(name, math.prod(others))
    require_volume(name, [counts[axis] for axis in spatial])


def _origin(header: Mapping[str, Any]) -> tuple[NDArray[np.float64], tuple[Remark, ...]]:
    origin = np.asarray(header.get("space origin", ()), np.float64)
    if origin.shape == (3,) and np.isfinite(origin).all():
        return origin, ()
    return np.zeros(3), (unlocated(),)


def _to_lps_mm(header: Mapping[str, Any], unit_mm: float) -> NDArray[np.float64]:
    """World axes of the file to LPS in millimetres; an unnamed space is left as it is."""
    signs = np.array(SIGNS_TO_LPS.get(_word(header, "space"), (1, 1, 1)), np.float64)
    return np.diag([*(signs * unit_mm), 1.0])


def _stated_mm(name: str, header: Mapping[str, Any]) -> float | None:
    """Millimetres per unit of the world; None where it is not stated.

    Units of the index axes count where those of the world are not given.
    """
    units = header.get("space units") or sorted(set(map(str, header.get("units", ()))) - {""})
    units = [str(unit).strip().lower() for unit in units]
    unknown = [unit for unit in units if _singular(unit) not in UNITS_MM]
    if unknown or len(units) not in (0, 1, 3):
        told = ", ".join(units)
        raise InputError(f"{name} gives its size in '{told}'; export it in mm")
    factors = {UNITS_MM[_singular(unit)] for unit in units if unit}
    if len(factors) > 1:
        raise InputError(f"{name} has axes in different units ({', '.join(units)}); export it in mm")
    return factors.pop() if factors else None


def _singular(unit: str) -> str:
    return unit if unit in UNITS_MM else unit.removesuffix("s")


# --- voxels -------------------------------------------------------------------------------------


def _voxels(
    path: Path, header: Mapping[str, Any], counts: Sequence[int], data: bytes
) -> tuple[NDArray[Any], int]:
    """The voxels, and how many bytes at least follow them."""
    dtype, count = _dtype(path.name, header), math.prod(counts)
    name, data = _apart(path, header, data)
    encoding = ENCODINGS[_word(header, "encoding")]
    first = _skip(name, header, "byte skip", -1)
    require_size(path.name, counts, 1 if encoding == "text" else dtype.itemsize)
    most = MOST_BYTES if first < 0 else count * dtype.itemsize + first + 1
    data = _plain(name, data, _skip(name, header, "line skip", 0), encoding, most)
    if encoding == "text":
        numbers = _parsed(name, data[max(first, 0) :], count)
        return numbers[:count].reshape(counts, order="F"), len(numbers) - count
    first = len(data) - count * dtype.itemsize if first < 0 else first
    left = len(data) - first - count * dtype.itemsize
    if first < 0 or left < 0:
        raise cut_off(name, count * dtype.itemsize, len(data) - max(first, 0))
    return np.frombuffer(data, dtype, count, first).reshape(counts, order="F"), left


def _plain(name: str, data: bytes, lines: int, encoding: str, most: int) -> bytes:
    """What is left after some lines, unpacked."""
    file = io.BytesIO(data)
    for _ in range(lines):
        file.readline()
    return unpacked(name, file, encoding, most) if encoding in ("gzip", "bzip2") else file.read()


def _parsed(name: str, data: bytes, count: int) -> NDArray[np.float64]:
    """Numbers written as text."""
    if count > MOST_NUMBERS:
        raise InputError(f"{name} writes {count:,} voxels as text; save it with encoding gzip")
    try:
        numbers = np.array(data.split(), np.float64)
    except ValueError as error:
        raise InputError(f"{name} has voxels that are no numbers; export it again") from error
    if len(numbers) < count:
        raise InputError(
            f"{name} is cut off: it announces {count:,} voxels and has {len(numbers):,}; copy it again"
        )
    return numbers


def _dtype(name: str, header: Mapping[str, Any]) -> np.dtype:
    """As pynrrd understands it, which it shows of one voxel."""
    import nrrd

    told = {key: _word(header, key) for key in ("type", "endian") if key in header}
    one = told | {"dimension": 1, "sizes": np.array([1]), "encoding": "raw"}
    try:
        dtype = nrrd.read_data(one, io.BytesIO(bytes(16))).dtype
    except (nrrd.NRRDError, *_DAMAGED) as error:
        told_type = f"'{told.get('type', '')[:40]}'"
        raise InputError(f"{name} has voxels of the unknown type {told_type}; export it again") from error
    if dtype.kind not in "iuf":
        raise InputError(f"{name} does not hold numbers; save whole-number labels")
    return dtype


def _word(header: Mapping[str, Any], field: str) -> str:
    return str(header.get(field, "")).strip().lower()


def _skip(name: str, header: Mapping[str, Any], field: str, least: int) -> int:
    count = int(header.get(field, 0))
    if not least <= count <= MOST_BYTES:
        raise InputError(f"{name} has a {field} of {count}; it is damaged, export it again")
    return count


def _apart(path: Path, header: Mapping[str, Any], data: bytes) -> tuple[str, bytes]:
    """Name and bytes of the file that holds the voxels."""
    told = str(header.get("data file", ""))
    if not told:
        return path.name, data
    apart = beside(path, told)
    return apart.name, stored(apart)
