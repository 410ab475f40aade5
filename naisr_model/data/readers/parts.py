"""What a reader finds in a file, and what all readers share."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from naisr_model.data.remarks import Remark
from naisr_model.errors import InputError

NO_FACES = np.zeros((0, 3), np.int64)

C_TYPES = {"char": "i1", "short": "i2", "int": "i4", "float": "f4", "double": "f8"}
"""Types of numbers as several formats call them, and as NumPy does."""


class Parts(NamedTuple):
    """What is in a file of a shape.

    Attributes:
        points: coordinates as in the file, ``[n, 3]``.
        faces: triangles, ``[m, 3]``.
        lines: how many lines and polylines there are beside them.
        remarks: what is odd about the file.
    """

    points: NDArray[np.float64]
    faces: NDArray[np.int64] = NO_FACES
    lines: int = 0
    remarks: tuple[Remark, ...] = ()


def cut_off(name: str, what: str, announced: int, found: int) -> InputError:
    """The error of a file that holds less than it says."""
    return InputError(
        f"{name} is cut off: it announces {announced:,} {what} and holds {found:,}; copy or export it again"
    )


def trailing(count: int) -> tuple[Remark, ...]:
    """What is said of bytes after the end of the content."""
    return (Remark("fine", "trailing", f"{count:,} bytes after the end were left out"),) if count else ()


def numbers_of(words: Sequence[bytes]) -> NDArray[np.float64]:
    """Words of a text as numbers.

    Raises:
        ValueError: when one is none.
    """
    if not words:
        return np.zeros(0)
    if max(map(len, words)) > _LONGEST_NUMBER:  # an array of them would be as wide as the longest
        raise ValueError("a word that is no number")
    return np.array(words, dtype="S").astype(np.float64)


_LONGEST_NUMBER = 64


def check_indices(name: str, indices: NDArray[np.int64], points: int) -> None:
    """Refuse indices of points that are not there.

    Raises:
        InputError: then.
    """
    if len(indices) and not 0 <= indices.min() <= indices.max() < points:
        raise InputError(f"{name} has faces that name missing vertices; export it again")


def triangulated(
    name: str, points: NDArray[np.float64], counts: NDArray[np.int64], corners: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Polygons, given by their numbers of corners and all their corners in a row, as triangles ``[m, 3]``."""
    check_indices(name, corners, len(points))
    if (counts == 3).all():
        return corners.reshape(-1, 3)
    import pyvista

    starts = np.cumsum(counts) - counts
    cells = np.insert(corners, starts, counts)
    polygons = pyvista.PolyData(np.where(np.isfinite(points), points, 0.0), cells)
    with silent_vtk():
        return np.asarray(polygons.triangulate().regular_faces, np.int64).reshape(-1, 3)


def from_strips(strips: Sequence[NDArray[np.int64]]) -> NDArray[np.int64]:
    """Strips of triangles, each of which turns the other way, as triangles ``[m, 3]``."""
    found = [NO_FACES]
    for strip in strips:
        faces = np.stack([strip[:-2], strip[1:-1], strip[2:]], axis=1)
        faces[1::2] = faces[1::2, ::-1]
        found.append(faces)
    faces = np.concatenate(found)
    same = (faces == np.roll(faces, 1, axis=1)).any(axis=1)
    return faces[~same]


_vtk_is_silent = threading.Lock()


@contextmanager
def silent_vtk() -> Iterator[Any]:
    """VTK's words go into the window that is given, from which they can be taken, and nowhere else."""
    from vtkmodules.vtkCommonCore import vtkLogger, vtkOutputWindow, vtkStringOutputWindow

    with _vtk_is_silent:
        before, verbosity = vtkOutputWindow.GetInstance(), vtkLogger.GetCurrentVerbosityCutoff()
        words = vtkStringOutputWindow()
        vtkOutputWindow.SetInstance(words)
        vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
        try:
            yield words
        finally:
            vtkOutputWindow.SetInstance(before)
            vtkLogger.SetStderrVerbosity(verbosity)
