"""Wavefront OBJ: vertices, polygons and lines; everything else is passed over."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from naisr_model.data.readers.parts import NO_FACES, Parts, cut_off, numbers_of, triangulated
from naisr_model.errors import InputError

_ANNOUNCED = {
    "vertices": re.compile(
        rb"^#\s*(?:vertices\s*:\s*(\d+)|(\d+)\s+vertices)\s*$", re.MULTILINE | re.IGNORECASE
    ),
    "faces": re.compile(rb"^#\s*(?:faces\s*:\s*(\d+)|(\d+)\s+faces)\s*$", re.MULTILINE | re.IGNORECASE),
}
"""What some writers put into comments, of the whole file or of each object."""


def read(name: str, content: bytes) -> Parts:
    """Read an OBJ file.

    Raises:
        InputError: when a line is not understood, or there is less than a comment announces.
    """
    vertices, counts, corners, lines = list[bytes](), list[int](), list[int](), 0
    for number, line in enumerate(content.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").splitlines(), 1):
        words = line.split(b"#", 1)[0].split()
        if not words:
            continue
        if words[0] == b"v":
            if len(words) < 4:
                raise _stopped(name, number, line)
            vertices += words[1:4]
        elif words[0] == b"f":
            try:
                face = [int(word.split(b"/", 1)[0]) for word in words[1:]]
            except ValueError:
                raise _stopped(name, number, line) from None
            if len(face) < 3 or 0 in face:
                raise _stopped(name, number, line)
            so_far = len(vertices) // 3
            corners += [corner - 1 if corner > 0 else so_far + corner for corner in face]
            counts.append(len(face))
        elif words[0] == b"l":
            lines += 1
    points = _points(name, vertices, content)
    _check_announced(name, content, {"vertices": len(points), "faces": len(counts)})
    polygons = np.array(counts, np.int64), np.array(corners, np.int64)
    faces = triangulated(name, points, *polygons) if counts else NO_FACES
    return Parts(points, faces, lines)


def _points(name: str, words: list[bytes], content: bytes) -> NDArray[np.float64]:
    try:
        return numbers_of(words).reshape(-1, 3)
    except ValueError:
        pass
    for number, line in enumerate(content.splitlines(), 1):
        parts = line.split()
        if parts[:1] == [b"v"]:
            try:
                numbers_of(parts[1:4])
            except ValueError:
                raise _stopped(name, number, line) from None
    raise InputError(f"{name} has vertices that are no numbers; export it again")


def _stopped(name: str, number: int, line: bytes) -> InputError:
    shown = line.decode("utf-8", "replace").strip()[:60]
    return InputError(f"{name}: line {number} ('{shown}') is not understood or cut off; export it again")


def _check_announced(name: str, content: bytes, found: dict[str, int]) -> None:
    for what, pattern in _ANNOUNCED.items():
        announced = sum(int(one or other) for one, other in pattern.findall(content))
        if found[what] < announced:
            raise cut_off(name, what, announced, found[what])
