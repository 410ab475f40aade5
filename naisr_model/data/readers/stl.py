"""STL, as text and binary."""

from __future__ import annotations

import re
import struct

import numpy as np
from numpy.typing import NDArray

from naisr_model.data.formats import is_text
from naisr_model.data.readers.parts import Parts, cut_off, numbers_of, trailing
from naisr_model.data.remarks import Remark
from naisr_model.errors import InputError

_HEADER_BYTES = 84
_FACE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_NO_COUNT = (0, 0xFFFFFFFF)
"""What writers put down that do not know the count while they write; the file's length tells it then."""

_VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)
_FACET = re.compile(rb"^\s*facet\b", re.IGNORECASE | re.MULTILINE)
_LAST = re.compile(rb"end\s*solid", re.IGNORECASE)


def read(name: str, content: bytes) -> Parts:
    """Read an STL file.

    Raises:
        InputError: when it is cut off, or a line of text is not understood.
    """
    is_words = content[:1024].lstrip()[:5].lower() == b"solid" and is_text(content)
    return _text(name, content) if is_words else _binary(name, content)


def _binary(name: str, content: bytes) -> Parts:
    (announced,) = struct.unpack_from("<I", content, 80)
    room, rest = divmod(len(content) - _HEADER_BYTES, _FACE.itemsize)
    count = room if announced in _NO_COUNT else announced
    if announced == 0 and room and not _is_plausible(content):
        count = 0
    if count > room:
        raise cut_off(name, "faces", count, room)
    corners = np.frombuffer(content, _FACE, count, _HEADER_BYTES)["corners"]
    points, faces = _merged(corners.reshape(-1, 3))
    left = len(content) - _HEADER_BYTES - count * _FACE.itemsize
    return Parts(points, faces, remarks=trailing(rest if count == room else left))


def _is_plausible(content: bytes) -> bool:
    """Whether what follows a count of 0 are faces: their coordinates are numbers of ordinary size."""
    first = np.frombuffer(content, _FACE, 1, _HEADER_BYTES)["corners"]
    return bool((np.abs(first) < 1e9).all())  # false for what is no number


def _merged(corners: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Points that are written once a face, as shared ones."""
    with np.errstate(invalid="ignore"):
        numbers = np.ascontiguousarray(corners + np.float32(0.0))  # of -0 and 0 one
    keys = numbers.view([("", numbers.dtype)] * 3).ravel()
    _, first, index = np.unique(keys, return_index=True, return_inverse=True)
    return numbers[first].astype(np.float64), index.reshape(-1, 3).astype(np.int64)


def _text(name: str, content: bytes) -> Parts:
    """Only the vertices count: writers agree on little else."""
    found = _VERTEX.findall(content)
    try:
        corners = numbers_of([word for vertex in found for word in vertex]).reshape(-1, 3)
    except ValueError:
        raise _stopped(name, content) from None
    facets = len(_FACET.findall(content))
    if len(corners) != 3 * facets:
        raise _stopped(name, content, facets)
    points, faces = _merged64(corners)
    ended = _LAST.search(content, max(0, content.rstrip().rfind(b"\n"))) or _LAST.search(content)
    unsure = Remark("look", "ending", "the file has no 'endsolid'", "see whether the surface is whole")
    return Parts(points, faces, remarks=() if ended else (unsure,))


def _merged64(corners: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    points, index = np.unique(corners + 0.0, axis=0, return_inverse=True)
    return points, index.reshape(-1, 3).astype(np.int64)


def _stopped(name: str, content: bytes, facets: int = -1) -> InputError:
    """The line where reading stops: a vertex without three numbers, or a facet without three vertices."""
    vertices = 3
    for number, line in enumerate(content.splitlines(), start=1):
        words = line.lower().split()
        if words[:1] == [b"vertex"]:
            vertices += 1
            if not _are_numbers(words[1:4]):
                return _at(name, number, line, "has no three numbers")
        elif words[:1] == [b"facet"]:
            if vertices != 3:
                return _at(name, number, line, f"follows a face of {vertices} corners where STL has three")
            vertices = 0
    return InputError(
        f"{name} is cut off: it announces {max(facets, 0):,} faces and the last has {vertices} corners; "
        "copy or export it again"
    )


def _are_numbers(words: list[bytes]) -> bool:
    try:
        return len([float(word) for word in words]) == 3
    except ValueError:
        return False


def _at(name: str, number: int, line: bytes, what: str) -> InputError:
    shown = line.decode("utf-8", "replace").strip()[:60]
    return InputError(f"{name}: line {number} ('{shown}') {what}; export it again, as binary STL if you can")
