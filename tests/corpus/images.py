"""The egg as a label volume in NIfTI, NRRD and MetaImage; written here and not by a library."""

from __future__ import annotations

import gzip
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Literal

import numpy as np
from eggs import egg
from numpy.typing import NDArray

SPACING_MM = (1.5, 1.5, 2.5)
Order = Literal["<", ">"]
_COUNTS = (37, 35, 33)
_NIFTI_TYPES = {
    "u1": 2,
    "i2": 4,
    "i4": 8,
    "f4": 16,
    "f8": 64,
    "i1": 256,
    "u2": 512,
    "u4": 768,
    "i8": 1024,
    "u8": 1280,
}
_NRRD_TYPES = {
    "u1": "unsigned char",
    "i1": "signed char",
    "u2": "unsigned short",
    "i2": "short",
    "u4": "unsigned int",
    "i4": "int",
    "u8": "unsigned long long",
    "i8": "long long",
    "f4": "float",
    "f8": "double",
}


@cache
def _inside() -> NDArray[np.bool_]:
    index = np.stack(np.meshgrid(*map(np.arange, _COUNTS), indexing="ij"), axis=-1)
    half = np.abs(egg(6.0, 1.0).bounds[0])
    at = (index - (np.array(_COUNTS) - 1) / 2) * SPACING_MM
    inside: NDArray[np.bool_] = ((at / half) ** 2).sum(axis=-1) < 1
    return inside


def labels(value: float = 1, kind: str = "u1", background: float = 0) -> NDArray:
    """The egg's voxels, ``[i, j, k]``."""
    return np.where(_inside(), value, background).astype(kind)


def two_labels(kind: str = "u1") -> NDArray:
    """Label 1 a block in a corner, label 2 the egg."""
    both = labels(2, kind)
    both[:4, :4, :4] = 1
    return both


VOLUME = float(_inside().sum() * np.prod(SPACING_MM)) / 1000
"""Of the voxels, in cm³."""


def placed(spacing: Sequence[float] = SPACING_MM, turn: NDArray | None = None) -> NDArray[np.float64]:
    """4x4: voxel indices to RAS millimetres, the egg's middle at 0."""
    matrix = np.eye(4)
    matrix[:3, :3] = (np.eye(3) if turn is None else turn) * np.asarray(spacing, float)
    matrix[:3, 3] = -matrix[:3, :3] @ ((np.array(_COUNTS) - 1) / 2)
    return matrix


def turned(degrees: float) -> NDArray[np.float64]:
    """A turn about z."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


@dataclass(frozen=True, eq=False)
class Nifti:
    """What the header of a NIfTI file says; the form that is None is not used.

    Attributes:
        spacing: pixdim 1 to 3.
        sform: 4x4.
        qform: 4x4, of a turn about z and a shift, in the spacing that pixdim says.
        slope: scl_slope.
        inter: scl_inter.
        units: xyzt_units.
        dims: dim, where it is not the truth.
        order: < or >.
        version: 1 or 2.
        magic: of single files.
    """

    spacing: Sequence[float] = SPACING_MM
    sform: NDArray | None = field(default_factory=placed)
    qform: NDArray | None = None
    slope: float = 0.0
    inter: float = 0.0
    units: int = 2
    dims: Sequence[int] | None = None
    order: Order = "<"
    version: int = 1
    magic: bytes | None = None

    def file(self, voxels: NDArray) -> bytes:
        """The whole file."""
        header = self._first(voxels) if self.version == 1 else self._second(voxels)
        body = voxels.astype(voxels.dtype.newbyteorder(self.order)).tobytes(order="F")
        return header + bytes(4) + body

    def _common(self, voxels: NDArray) -> tuple[list[int], int, int, list[float]]:
        dims = list(self.dims or (voxels.ndim, *voxels.shape))
        pixdim = [1.0, *map(float, self.spacing)]
        code = _NIFTI_TYPES[voxels.dtype.str[1:]]
        return (dims + [1] * 8)[:8], code, 8 * voxels.dtype.itemsize, (pixdim + [1.0] * 8)[:8]

    def _quaternion(self) -> list[float]:
        """b, c, d and the offset of a turn about z."""
        if self.qform is None:
            return [0.0] * 6
        angle = np.arctan2(self.qform[1, 0], self.qform[0, 0])
        return [0.0, 0.0, float(np.sin(angle / 2)), *self.qform[:3, 3].tolist()]

    def _forms(self) -> list[float]:
        return [0.0] * 12 if self.sform is None else np.asarray(self.sform, float)[:3].ravel().tolist()

    def _codes(self) -> tuple[int, int]:
        return int(self.qform is not None), int(self.sform is not None)

    def _first(self, voxels: NDArray) -> bytes:
        dims, code, bits, pixdim = self._common(voxels)
        e = self.order
        parts = [
            struct.pack(f"{e}i36x", 348),
            struct.pack(f"{e}8h", *dims),
            bytes(14),
            struct.pack(f"{e}hhh", code, bits, 0),
            struct.pack(f"{e}8f", *pixdim),
            struct.pack(f"{e}fff", 352.0, self.slope, self.inter),
            struct.pack(f"{e}hbB", 0, 0, self.units),
            bytes(4 * 6 + 80 + 24),
            struct.pack(f"{e}hh", *self._codes()),
            struct.pack(f"{e}6f", *self._quaternion()),
            struct.pack(f"{e}12f", *self._forms()),
            bytes(16),
            self.magic or b"n+1\0",
        ]
        return b"".join(parts)

    def _second(self, voxels: NDArray) -> bytes:
        dims, code, bits, pixdim = self._common(voxels)
        e = self.order
        parts = [
            struct.pack(f"{e}i", 540),
            self.magic or b"n+2\0\r\n\x1a\n",
            struct.pack(f"{e}hh", code, bits),
            struct.pack(f"{e}8q", *dims),
            bytes(24),
            struct.pack(f"{e}8d", *pixdim),
            struct.pack(f"{e}q", 544),
            struct.pack(f"{e}dd", self.slope, self.inter),
            bytes(8 * 4 + 8 * 2 + 80 + 24),
            struct.pack(f"{e}ii", *self._codes()),
            struct.pack(f"{e}6d", *self._quaternion()),
            struct.pack(f"{e}12d", *self._forms()),
            struct.pack(f"{e}iii", 0, self.units, 0),
            bytes(16),
            bytes(1 + 15),
        ]
        header = b"".join(parts)
        assert len(header) == 540, len(header)
        return header


def nifti(voxels: NDArray | None = None, **header: Any) -> bytes:
    """A NIfTI file of voxels, the egg's where none are given."""
    return Nifti(**header).file(labels() if voxels is None else voxels)


def nifti_gz(voxels: NDArray | None = None) -> bytes:
    """The same, packed."""
    return gzip.compress(nifti(voxels), mtime=0)


def nrrd(
    voxels: NDArray | None = None,
    *,
    encoding: str = "raw",
    order: Order = "<",
    drop: Sequence[str] = (),
    matrix: NDArray | None = None,
    end: str = "\n",
    **fields: Any,
) -> bytes:
    """A NRRD file; ``fields`` are more lines of the header, or other ones, with _ for a space."""
    voxels = labels() if voxels is None else voxels
    matrix = placed() if matrix is None else matrix
    axes = " ".join("(" + ",".join(f"{x:.9g}" for x in matrix[:3, i]) + ")" for i in range(3))
    told: dict[str, object] = {
        "type": _NRRD_TYPES[voxels.dtype.str[1:]],
        "dimension": voxels.ndim,
        "space": "right-anterior-superior",
        "sizes": " ".join(map(str, voxels.shape)),
        "space directions": axes,
        "kinds": "domain domain domain",
        "endian": {"<": "little", ">": "big"}[order],
        "encoding": encoding,
        "space origin": "(" + ",".join(f"{x:.9g}" for x in matrix[:3, 3]) + ")",
    }
    told |= {name.replace("_", " "): value for name, value in fields.items()}
    lines = ["NRRD0005", *(f"{name}: {value}" for name, value in told.items() if name not in drop)]
    return (end.join(lines) + 2 * end).encode() + _packed(voxels, encoding, order)


def pair(voxels: NDArray | None = None, **header: Any) -> dict[str, bytes]:
    """The same egg as a NIfTI header and its image beside it."""
    whole = Nifti(**{"magic": b"ni1\0"} | header).file(labels() if voxels is None else voxels)
    size = 348 if header.get("version", 1) == 1 else 540
    start = bytearray(whole[:size])
    at = slice(108, 112) if size == 348 else slice(168, 176)
    start[at] = bytes(at.stop - at.start)  # the image begins with its voxels
    return {"egg.hdr": bytes(start), "egg.img": whole[size + 4 :]}


def analyze(voxels: NDArray | None = None) -> dict[str, bytes]:
    """The same as Analyze, which has no magic and no place."""
    files = pair(voxels, sform=None)
    return files | {"egg.hdr": files["egg.hdr"][:252] + bytes(96)}


_METAIMAGE_TYPES = {
    "u1": "UCHAR",
    "i1": "CHAR",
    "u2": "USHORT",
    "i2": "SHORT",
    "u4": "UINT",
    "i4": "INT",
    "u8": "ULONG_LONG",
    "i8": "LONG_LONG",
    "f4": "FLOAT",
    "f8": "DOUBLE",
}


def metaimage(
    voxels: NDArray | None = None,
    *,
    packed: bool = False,
    order: Order = "<",
    drop: Sequence[str] = (),
    end: str = "\n",
    file: str = "LOCAL",
    **fields: object,
) -> bytes:
    """A MetaImage; ``fields`` are more or other lines. Voxels in another ``file`` are left out."""
    voxels = labels() if voxels is None else voxels
    matrix = np.diag([-1.0, -1.0, 1.0, 1.0]) @ placed()
    axes = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
    told: dict[str, object] = {
        "ObjectType": "Image",
        "NDims": voxels.ndim,
        "BinaryData": True,
        "BinaryDataByteOrderMSB": order == ">",
        "CompressedData": packed,
        "TransformMatrix": " ".join(f"{x:.9g}" for x in axes.T.ravel()),
        "Offset": " ".join(f"{x:.9g}" for x in matrix[:3, 3]),
        "CenterOfRotation": "0 0 0",
        "AnatomicalOrientation": "RAI",
        "ElementSpacing": " ".join(f"{x:g}" for x in SPACING_MM),
        "DimSize": " ".join(map(str, voxels.shape)),
        "ElementType": f"MET_{_METAIMAGE_TYPES[voxels.dtype.str[1:]]}",
    }
    told = told | fields | {"ElementDataFile": file}
    lines = end.join(f"{name} = {value}" for name, value in told.items() if name not in drop) + end
    body = _packed(voxels, "raw", order) if file == "LOCAL" else b""
    return lines.encode() + (zlib.compress(body) if packed else body)


def _packed(voxels: NDArray, encoding: str, order: Order) -> bytes:
    body = voxels.astype(voxels.dtype.newbyteorder(order)).tobytes(order="F")
    if encoding in ("gzip", "gz"):
        return gzip.compress(body, mtime=0)
    if encoding == "bzip2":
        import bz2

        return bz2.compress(body)
    if encoding in ("ascii", "text", "txt"):
        return (" ".join(map(str, voxels.ravel(order="F").tolist())) + "\n").encode()
    return body.hex().encode() if encoding == "hex" else body


def segment(number: int, value: int, name: str, layer: int = 0) -> dict[str, object]:
    """What 3D Slicer says of a segment, as lines of a NRRD header (``:=`` is what it writes)."""
    told = {"Name": name, "LabelValue": value, "Layer": layer}
    return {f"Segment{number}§{key}": f"={text}" for key, text in told.items()}


def slicer(voxels: NDArray, *segments: dict[str, object], **fields: Any) -> bytes:
    """A segmentation of 3D Slicer: ``segments`` from :func:`segment`."""
    told = {key: value for each in segments for key, value in each.items()}
    made = nrrd(voxels, **fields)
    lines = "".join(f"{key.replace('§', '_')}:{text}\n" for key, text in told.items()).encode()
    return made.replace(b"\n\n", b"\n" + lines + b"\n", 1)
