"""NIfTI-1 and NIfTI-2 in one file or a pair of header and image, and Analyze: read by nibabel, judged here.

nibabel would repair odd headers and say so on stderr; what is wrong with one is for the user to know.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from naisr_model.data.images.base import (
    MOST_SHIFT,
    Image,
    apart,
    content,
    cut_off,
    require_one_value,
    require_size,
    require_volume,
    shift,
    squared,
    surplus,
    unplaced,
    unspaced,
)
from naisr_model.data.remarks import Remark
from naisr_model.errors import InputError

RAS_TO_LPS = np.diag([-1.0, -1.0, 1.0, 1.0])
UNITS_MM = {1: 1000.0, 2: 1.0, 3: 0.001}
"""Metres, millimetres and micrometres; other codes, as 0 for unknown, state no unit: millimetres, then."""

_UNEQUAL = 0.01


def read_nifti(name: str, content: bytes) -> Image:
    """Read a NIfTI file; the axes are those that nibabel takes: sform, else qform, else pixdim.

    Args:
        name: of the file, for messages.
        content: the whole file, unpacked.

    Raises:
        InputError: when the file is damaged or cut off, or is no single volume of numbers.
    """
    from nibabel.nifti1 import Nifti1Header
    from nibabel.nifti2 import Nifti2Header

    header = _header(name, content, Nifti1Header if content[344:347] == b"n+1" else Nifti2Header)
    return _image(name, header, name, content, len(header.binaryblock) + 4)


def read_pair(path: Path, content_of_header: bytes) -> Image:
    """Read an image that lies beside its header; Analyze says nothing of how the patient lies.

    Args:
        path: of the header.
        content_of_header: the whole of it, unpacked.

    Raises:
        InputError: as :func:`read_nifti`, and when the image is not there.
    """
    from nibabel.nifti1 import Nifti1PairHeader
    from nibabel.nifti2 import Nifti2PairHeader
    from nibabel.spm2analyze import Spm2AnalyzeHeader

    start = content_of_header[:348]
    second = Nifti2PairHeader if start[4:7] == b"ni2" else Spm2AnalyzeHeader
    header = _header(path.name, content_of_header, Nifti1PairHeader if start[344:347] == b"ni1" else second)
    image = half(path, "img")
    if image is None:
        raise InputError(
            f"{path.name} is the header of a pair, and its image (.img) is not there; keep both together"
        )
    return _image(path.name, header, image.name, content(image), 0)


def half(path: Path, other: Literal["hdr", "img"]) -> Path | None:
    """The other file of a pair, which has the same name but for the ending."""
    stem = re.sub(r"\.\w+(\.gz)?$", "", path.name, flags=re.IGNORECASE)
    names = (f"{stem}.{ending}{gz}" for gz in ("", ".gz", ".GZ") for ending in (other, other.upper()))
    return next((half for name in names if (half := path.with_name(name)) != path and half.is_file()), None)


def _image(name: str, header: Any, name_of_voxels: str, content: bytes, least: int) -> Image:
    """What a header says of voxels that begin at ``least`` or later."""
    counts, dtype = _counts(name, header), _dtype(name, header)
    require_size(name, counts, dtype.itemsize)
    require_one_value(name, math.prod(counts[3:]))
    require_volume(name, counts)
    counts = counts[:3]
    slope, intercept = _scale(name, header)
    first = max(_offset(name, header), least)
    voxels, left = _voxels(name_of_voxels, memoryview(content)[first:], counts, dtype)
    ras = _matrix(name, header)
    unit_mm = _stated_mm(header)
    lps_mm, squared_remarks = squared(name, _in_mm(unit_mm) @ RAS_TO_LPS, ras, counts)
    placed = (*_position_remarks(header, ras, counts), *_spacing_remarks(header, ras), *squared_remarks)
    return Image(voxels[None], lps_mm, {}, (*placed, *surplus(left)), slope, intercept, unit_mm)


def _header(name: str, content: bytes, kind: Any) -> Any:
    size = kind.template_dtype.itemsize
    if len(content) < size:
        raise InputError(f"{name} is cut off; copy or export it again")
    return kind(content[:size], check=False)


def _counts(name: str, header: Any) -> list[int]:
    dimensions = int(header["dim"][0])
    if not 1 <= dimensions <= 7:
        raise InputError(f"{name} announces {dimensions} dimensions; it is damaged, export it again")
    counts = [int(count) for count in header["dim"][1 : dimensions + 1]]
    while len(counts) > 3 and counts[-1] == 1:
        counts.pop()
    return counts


def _dtype(name: str, header: Any) -> np.dtype:
    from nibabel.spatialimages import HeaderDataError

    try:
        dtype = header.get_data_dtype()
    except (HeaderDataError, KeyError) as error:
        raise InputError(f"{name} has voxels of an unknown type ({error}); export it again") from error
    if dtype.names or dtype.kind not in "iuf":
        raise InputError(f"{name} holds colours or complex numbers; save whole-number labels")
    return dtype


def _scale(name: str, header: Any) -> tuple[float, float]:
    from nibabel.spatialimages import HeaderDataError

    try:
        slope, intercept = header.get_slope_inter()
    except HeaderDataError as error:
        raise InputError(f"{name} has values that cannot be scaled ({error}); export it again") from error
    return (1.0, 0.0) if slope is None else (slope, intercept)


def _offset(name: str, header: Any) -> int:
    first = float(header["vox_offset"])
    if not 0 <= first < math.inf:
        raise InputError(f"{name} does not say where its voxels begin; it is damaged, export it again")
    return int(first)


def _voxels(name: str, content: memoryview, counts: list[int], dtype: np.dtype) -> tuple[NDArray[Any], int]:
    """The voxels, and how many bytes follow them."""
    count = math.prod(counts)
    left = len(content) - count * dtype.itemsize
    if left < 0:
        raise cut_off(name, count * dtype.itemsize, len(content))
    return np.frombuffer(content, dtype, count).reshape(counts, order="F"), left


def _matrix(name: str, header: Any) -> NDArray[np.float64]:
    """Voxel indices to RAS in the file's unit."""
    if _is_coded(header, "sform"):
        return np.asarray(header.get_sform(), np.float64)
    spacing = header["pixdim"][1:4]
    if not (np.isfinite(spacing) & (spacing > 0)).all():
        raise unspaced(name, spacing)
    if not _is_coded(header, "qform"):
        return np.asarray(header.get_best_affine(), np.float64)
    matrix = _qform(header)
    if matrix is None:
        raise InputError(f"{name} has a damaged orientation (qform); set it and export it again")
    return matrix


def _is_coded(header: Any, form: str) -> bool:
    return bool(header.get(f"{form}_code", 0) != 0)


def _qform(header: Any) -> NDArray[np.float64] | None:
    """None where it is damaged; its handedness may be left out, which is then the usual one."""
    header = header.copy()
    if header["pixdim"][0] not in (-1, 1):
        header["pixdim"][0] = 1
    try:
        matrix = np.asarray(header.get_qform(), np.float64)
    except ValueError:  # also nibabel's HeaderDataError
        return None
    return matrix if np.isfinite(matrix).all() else None


def _stated_mm(header: Any) -> float | None:
    return UNITS_MM.get(int(header.get("xyzt_units", 0)) & 7)


def _in_mm(unit_mm: float | None) -> NDArray[np.float64]:
    factor = unit_mm or 1.0
    return np.diag([factor, factor, factor, 1.0])


def _position_remarks(header: Any, used: NDArray[np.float64], counts: list[int]) -> tuple[Remark, ...]:
    if not _is_coded(header, "sform") and not _is_coded(header, "qform"):
        return (unplaced(),)
    other = _qform(header) if _is_coded(header, "qform") else used
    if other is None or shift(used, other, counts) <= MOST_SHIFT:
        return ()
    most_mm = np.linalg.norm(apart(used, other, counts), axis=0).max() * (_stated_mm(header) or 1.0)
    sentence = (
        f"the file places the image in two ways, which differ by up to {most_mm:.3g} mm (sform and qform); "
        "the sform is used"
    )
    return (Remark("look", "orientation", sentence, "check place, size and sides against the scan"),)


def _spacing_remarks(header: Any, used: NDArray[np.float64]) -> tuple[Remark, ...]:
    told, steps = np.asarray(header["pixdim"][1:4], np.float64), np.linalg.norm(used[:3, :3], axis=0)
    if (np.abs(told - steps) <= _UNEQUAL * steps).all():
        return ()
    unit = _stated_mm(header) or 1.0
    one, other = (" x ".join(f"{step * unit:.3g}" for step in each) for each in (told, steps))
    sentence = f"the file gives its voxels {one} mm (pixdim) and {other} mm (sform); the latter is used"
    return (Remark("look", "spacing", sentence, "compare the volume with the one you expect"),)
