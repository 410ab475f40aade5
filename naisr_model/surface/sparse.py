"""A field evaluated only near its zero level set.

An octree walks from blocks of :data:`COARSEST` cells down to single cells. A block can hold a piece
of the surface only where the field at its centre is at most the field's steepest slope times half
the block's diagonal; all other blocks are done, with the sign of their centre. The steepest slope is
measured on the field itself.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from naisr_model.errors import Cancelled
from naisr_model.surface.lattice import Lattice

Field = Callable[[NDArray[np.float32]], NDArray[np.float32]]
"""Signed distances in model units, ``[n]``, at points in model units, ``[n, dim]``."""

COARSEST = 8
"""Cells along a side of the largest blocks."""

LEAST_BOUND, SAFETY = 2.0, 1.5
"""Blocks are tested with the steepest slope between neighbouring coarse centres times ``SAFETY``, at least
``LEAST_BOUND``. A distance has slope 1, but a template shrunk to a third has slope 3."""

CHUNK = 16_384
"""Points evaluated between two looks at ``should_stop``."""


def evaluate_everywhere(
    field: Field,
    lattice: Lattice,
    progress: Callable[[float], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> NDArray[np.float32]:
    """The field at every node, shape ``lattice.shape``: the reference for :func:`evaluate_band`."""
    values = _chunked(field, lattice.points(lattice.nodes()), progress, should_stop)
    return values.reshape(lattice.shape)


def evaluate_band(
    field: Field,
    lattice: Lattice,
    progress: Callable[[float], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> NDArray[np.float32]:
    """The field near its zero level set and its sign elsewhere, shape ``lattice.shape``.

    Args:
        field: the signed distance.
        lattice: ``lattice.resolution`` must be a multiple of :data:`COARSEST`.
        progress: told the finished share.
        should_stop: polled between chunks.

    Raises:
        Cancelled: when ``should_stop()`` turned true.
    """
    size = COARSEST
    blocks = Lattice(lattice.resolution // size - 1, lattice.dim).nodes() * size
    values = np.empty(lattice.shape, np.float32)
    done, slope = 0.0, LEAST_BOUND
    while size > 1:
        centres = lattice.points(blocks + size / 2)
        centre_values = _chunked(field, centres, None, should_stop)
        if size == COARSEST:
            slope = max(LEAST_BOUND, SAFETY * _steepest(centre_values, lattice))
        near = np.abs(centre_values) <= slope * lattice.spacing * size / 2 * np.sqrt(lattice.dim)
        for offset in _corners(lattice.dim, size + 1):
            values[_array_index(blocks[~near] + offset)] = centre_values[~near]
        size //= 2
        blocks = np.concatenate(
            [blocks[near] + np.multiply(offset, size) for offset in _corners(lattice.dim, 2)]
        )
        done += 0.1
        if progress is not None:
            progress(done)
    nodes = _corner_nodes(blocks, lattice)
    rest = None if progress is None else lambda share: progress(done + (1 - done) * share)
    values[_array_index(nodes)] = _chunked(field, lattice.points(nodes), rest, should_stop)
    return values


def _steepest(centre_values: NDArray[np.float32], lattice: Lattice) -> float:
    """Largest slope along an axis between the centres of neighbouring coarsest blocks."""
    blocks = centre_values.reshape((lattice.resolution // COARSEST,) * lattice.dim)
    steps = [np.abs(np.diff(blocks, axis=axis)).max() for axis in range(lattice.dim)]
    return float(max(steps)) / (COARSEST * lattice.spacing)


def _corners(dim: int, count: int) -> list[tuple[int, ...]]:
    return list(itertools.product(range(count), repeat=dim))


def _corner_nodes(cells: NDArray[np.intp], lattice: Lattice) -> NDArray[np.intp]:
    """The distinct nodes of these cells, in lattice order."""
    marked = np.zeros(lattice.shape, bool)
    for offset in _corners(lattice.dim, 2):
        marked[_array_index(cells + offset)] = True
    return np.ascontiguousarray(np.argwhere(marked)[:, ::-1])


def _array_index(indices: NDArray[np.intp]) -> tuple[NDArray[np.intp], ...]:
    return tuple(indices.T[::-1])


def _chunked(
    field: Field,
    points: NDArray[np.float32],
    progress: Callable[[float], None] | None,
    should_stop: Callable[[], bool] | None,
) -> NDArray[np.float32]:
    values = np.empty(len(points), np.float32)
    for start in range(0, len(points), CHUNK):
        if should_stop is not None and should_stop():
            raise Cancelled
        values[start : start + CHUNK] = field(points[start : start + CHUNK])
        if progress is not None:
            progress(min(1.0, (start + CHUNK) / len(points)))
    return values
