"""A field evaluated only near its zero level set.

Blocks of cells are halved, level by level, down to single cells. Between the corners of a block the
field is taken for their multilinear interpolation, give or take a bound. A half that this keeps from
changing sign is done; the nodes of the others are evaluated. The bound is measured on the field:
:data:`KINK` times its second differences about the block, plus a slack. Every value that the walk
meets is held against it, and where one breaks it the slack is raised and the walk repeated: what is
known stays known, and only the halves that are now in question are evaluated. At last the surface is
followed, cell by cell, wherever it leaves the evaluated cells.

Where a guess of the field is at hand that costs next to nothing, the blocks are halved on the guess. The
field itself is evaluated at the ends of the edges that the surface crosses, for only these place it, and
where the guess is nearer to zero than it may err. How far it errs is measured wherever both are known.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from naisr_model.progress import SILENT, Progress
from naisr_model.surface.lattice import Lattice

Field = Callable[[NDArray[np.float32]], NDArray[np.float32]]
"""Signed distances in model units, ``[n]``, at points in model units, ``[n, dim]``."""

Cells = NDArray[np.intp]
"""Lowest nodes (x, y[, z]) of blocks or cells, ``[n, dim]``."""

COARSEST = 8
"""Resolutions are multiples of this, so that blocks can be halved."""

LEAST_BLOCKS = 16
"""Blocks along a side of the box on the coarsest level, at least."""

PROBED_BLOCKS = 8
"""Blocks along a side of the box, at least, at whose corners a guess is held against the field."""

LEAST_MISLED, MOST_MISLED = 0.5, 2.0
"""Cells; a guess is taken to mislead by the one at least, and saves little where it does by the other."""

KINK, SAFETY = 0.5, 1.5
"""A kink halfway between two samples is missed by half of their second difference (a parabola by an
eighth): that share of it, times ``SAFETY``, bounds the error of interpolation."""

LEAST_SLACK = 1e-6
"""Model units; the field's own rounding."""

MARKED_AT_ONCE = 1_000_000
"""Nodes; bounds the memory that marking the inside takes."""

CHUNK = 4096
"""Points evaluated between two looks at whether anybody waits for them."""


def evaluate_everywhere(field: Field, lattice: Lattice, progress: Progress = SILENT) -> NDArray[np.float32]:
    """The field at every node, shape ``lattice.shape``: the reference for :func:`evaluate_band`."""
    values = _chunked(field, lattice.points(lattice.nodes()), progress)
    return values.reshape(lattice.shape)


def evaluate_band(
    field: Field, lattice: Lattice, progress: Progress = SILENT, guess: Field | None = None
) -> NDArray[np.float32]:
    """The field at both ends of all edges that its zero level set crosses, and its sign elsewhere.

    A node that was not evaluated has the value infinity, minus infinity inside.

    Args:
        field: the signed distance.
        lattice: ``lattice.resolution`` must be a multiple of :data:`COARSEST`.
        progress: told the finished share, checked between chunks.
        guess: about the same, and much cheaper. It saves evaluations; one that proves wrong is put aside.

    Returns:
        Shape ``lattice.shape``.

    Raises:
        Cancelled: when nobody waits for it any more.
    """
    band = _Band(field, lattice, _Meter(progress))
    if guess is None or not _settle(band, _Band(guess, lattice, _Meter(progress.quiet))):
        _search(band, LEAST_SLACK)
    band.meter.tell(1.0)
    return band.values


class _Meter:
    """Passes on a share that never falls, though a repeated walk starts again."""

    def __init__(self, progress: Progress) -> None:
        self.progress, self.share = progress, 0.0

    def tell(self, share: float) -> None:
        self.share = max(self.share, share)
        self.progress.tell(self.share)

    def towards(self, end: float) -> Progress:
        """That of a piece which takes the share from where it is to ``end``."""
        return Progress(self.tell, self.progress.is_unwanted, self.share, end - self.share)


@dataclass(frozen=True, eq=False)
class _Band:
    """The values known so far, infinity where the field has not been evaluated."""

    field: Field
    lattice: Lattice
    meter: _Meter

    @cached_property
    def values(self) -> NDArray[np.float32]:
        """Shape ``lattice.shape``."""
        return np.full(self.lattice.shape, np.inf, np.float32)

    @cached_property
    def flat(self) -> NDArray[np.float32]:
        """The same values in a row."""
        return self.values.reshape(-1)

    @cached_property
    def strides(self) -> NDArray[np.intp]:
        """From a node to the next along x, y[, z] in that row."""
        return (self.lattice.resolution + 1) ** np.arange(self.lattice.dim)

    def at(self, cells: Cells, offsets: NDArray[np.intp]) -> NDArray[np.float32]:
        """Values at every cell's node plus ``offsets [k, dim]``, ``[n, k]``."""
        result: NDArray[np.float32] = self.flat[self.places(cells, offsets)]
        return result

    def places(self, cells: Cells, offsets: NDArray[np.intp]) -> NDArray[np.intp]:
        places: NDArray[np.intp] = (cells @ self.strides)[:, None] + offsets @ self.strides
        return places

    def nodes(self, places: NDArray[np.intp]) -> Cells:
        """Nodes (x, y[, z]) at these places in the row."""
        return np.stack(np.unravel_index(places, self.lattice.shape)[::-1], axis=-1)

    def open(self, cells: Cells, size: int) -> None:
        """Evaluate the corners of these cells of ``size`` that are not known."""
        places = self.places(cells, size * _offsets(self.lattice.dim, 2)).reshape(-1)
        places = _distinct(places[np.isinf(self.flat[places])])
        # Every level has about four times the points of the one before it.
        self.evaluate(places, 1 / size**2)

    def evaluate(self, places: NDArray[np.intp], end: float) -> None:
        """Evaluate the nodes at these places in the row; the meter is at ``end`` afterwards."""
        points = self.lattice.points(self.nodes(places))
        self.flat[places] = _chunked(self.field, points, self.meter.towards(end))

    def sink(self, blocks: Cells, size: int) -> None:
        """Mark what is not known of these blocks of ``size`` as inside."""
        offsets = _offsets(self.lattice.dim, size + 1)
        for some in np.array_split(blocks, 1 + len(blocks) * len(offsets) // MARKED_AT_ONCE):
            places = self.places(some, offsets).reshape(-1)
            self.flat[places[np.isinf(self.flat[places])]] = -np.inf


def _settle(band: _Band, guess: _Band) -> bool:
    """Evaluate the field where a guess does not tell its sign, and at both ends of all edges that it crosses.

    Returns:
        Whether that is enough. Where it is not, because the guess misleads by more than
        :data:`MOST_MISLED`, what was evaluated stays known.
    """
    band.open(*_blocks(band.lattice, PROBED_BLOCKS))
    doubt = 0.0
    while (misled := _misled(band, guess)) > doubt:
        doubt = SAFETY * misled
        if misled > MOST_MISLED * band.lattice.spacing:
            band.flat[np.isinf(band.flat)] = np.inf
            return False
        _search(guess, doubt)
        unknown = np.isinf(band.flat)
        band.flat[unknown] = np.inf
        band.flat[unknown & (guess.flat < 0)] = -np.inf
        near = np.flatnonzero(np.isfinite(guess.flat))
        doubtful = near[np.abs(guess.flat[near]) <= doubt]
        band.evaluate(doubtful[np.isinf(band.flat[doubtful])], 0.8)
        _cross(band, near)
    return True


def _misled(band: _Band, guess: _Band) -> float:
    """Up to which value, wherever the field is known, the guess promised too much.

    It promises the field's sign, and a value half as far from zero as its own. Values farther from zero
    mislead nobody: a guess may well be cut off far from the surface.
    """
    known = np.flatnonzero(np.isfinite(band.flat))
    guess.evaluate(known[np.isinf(guess.flat[known])], 1.0)
    signed = np.where(guess.flat[known] < 0, -band.flat[known], band.flat[known])
    misled = float((np.abs(guess.flat[known]) - 2 * signed).max())
    return max(LEAST_MISLED * band.lattice.spacing, misled)


def _cross(band: _Band, places: NDArray[np.intp]) -> None:
    """Evaluate both ends of the edges at these places on which the sign changes, and go on from there."""
    while len(places):
        places = _crossed(band, places)
        places = places[np.isinf(band.flat[places])]
        band.evaluate(places, 1.0)


def _crossed(band: _Band, places: NDArray[np.intp]) -> NDArray[np.intp]:
    """The ends of all edges at these places on which the sign changes."""
    nodes, found = band.nodes(places), []
    for axis, step in itertools.product(range(band.lattice.dim), (-1, 1)):
        across = nodes[:, axis] + step
        here = places[(across >= 0) & (across <= band.lattice.resolution)]
        there = here + step * band.strides[axis]
        crossed = (band.flat[here] < 0) != (band.flat[there] < 0)
        found += [here[crossed], there[crossed]]
    return _distinct(np.concatenate(found))


def _search(band: _Band, slack: float) -> None:
    """Evaluate the field wherever it can be zero, and mark the inside of the rest."""
    walked = _walk(band, slack)
    while walked.excess > 0:
        slack += SAFETY * max(walked.excess, slack)
        walked = _walk(band, slack)
    _follow(band, walked.cells)
    for size, blocks in walked.inside:
        band.sink(blocks, size)


@dataclass(frozen=True, eq=False)
class _Walk:
    """Where a walk came to.

    Attributes:
        cells: all their corners are known.
        inside: sizes of blocks that were left out because the field is negative there, and the blocks.
        excess: by how much a value exceeded its bound; 0 where none did.
    """

    cells: Cells
    inside: list[tuple[int, Cells]]
    excess: float


def _walk(band: _Band, slack: float) -> _Walk:
    """Halve blocks down to cells, leaving out what cannot hold the surface under this slack."""
    dim = band.lattice.dim
    cells, size = _blocks(band.lattice, LEAST_BLOCKS)
    bends = np.zeros(len(cells), np.float32)
    band.open(cells, size)
    inside, excess = [], 0.0
    while size > 1:
        # A parabola's second differences fall to a quarter from level to level.
        bends = np.maximum(bends / 4, _bends(band, cells, size))
        bounds = (SAFETY * KINK * bends + slack)[:, None]
        expected = band.at(cells, size * _offsets(dim, 2)) @ _halving(dim).T
        size //= 2
        corners = expected[:, _halves(dim)]
        lowest, highest = corners.min(axis=2), corners.max(axis=2)
        kept = (lowest <= bounds) & (highest >= -bounds)
        halves = cells[:, None] + size * _offsets(dim, 2)
        inside.append((size, halves[highest < -bounds]))
        band.open(halves[kept], size)
        misses = np.abs(band.at(cells, size * _offsets(dim, 3)) - expected) - bounds
        excess = max(excess, float(misses.max(initial=0.0, where=np.isfinite(misses))))
        cells, bends = halves[kept], bends[np.nonzero(kept)[0]]
    return _Walk(cells, inside, excess)


def _blocks(lattice: Lattice, count: int) -> tuple[Cells, int]:
    """Blocks that fill the box, at least ``count`` a side, and their size: a power of two."""
    size = 1
    while lattice.resolution % (2 * size) == 0 and lattice.resolution // (2 * size) >= count:
        size *= 2
    return Lattice(lattice.resolution // size - 1, lattice.dim).nodes() * size, size


def _bends(band: _Band, cells: Cells, size: int) -> NDArray[np.float32]:
    """The largest second difference along each axis at the corners of the blocks, summed over the axes."""
    dim, last = band.lattice.dim, band.lattice.resolution
    total = np.zeros(len(cells), np.float32)
    for axis in range(dim):
        corners = _offsets(dim, 2)
        corners = corners[corners[:, axis] == 0]
        before, low, high, after = (
            np.take(
                band.flat,
                band.places(cells, size * (corners + step * np.eye(dim, dtype=int)[axis])),
                mode="clip",
            )
            for step in (-1, 0, 1, 2)
        )
        before[cells[:, axis] == 0] = np.inf
        after[cells[:, axis] + 2 * size > last] = np.inf
        with np.errstate(invalid="ignore"):
            second = np.abs(np.concatenate([before - 2 * low + high, low - 2 * high + after], axis=1))
        total += second.max(axis=1, initial=0.0, where=np.isfinite(second))
    return total


def continued(values: NDArray[np.float32], lattice: Lattice) -> NDArray[np.float32]:
    """What :func:`evaluate_band` gave, and halfway between known values their mean, level by level.

    Near the zero level set that is as close as linear interpolation between neighbours.
    """
    values, (_, size) = values.copy(), _blocks(lattice, LEAST_BLOCKS)
    while size > 1:
        for axis in range(lattice.dim):
            steps = [size // 2 if earlier <= axis else size for earlier in range(lattice.dim)]
            level = np.moveaxis(values[tuple(slice(None, None, step) for step in steps)], axis, 0)
            between, ends = level[1::2], level[::2]
            np.copyto(between, (ends[:-1] + ends[1:]) / 2, where=np.isinf(between))
        size //= 2
    return values


def _follow(band: _Band, cells: Cells) -> None:
    """Open the neighbours of cells through whose faces the surface leaves what was evaluated.

    Values are held against the bounds of blocks on their own level only, so one on the side of a larger
    block that was left out may still disagree with it.
    """
    known = np.sort(cells @ band.strides)
    while len(cells):
        beyond = _distinct(_neighbours(band, cells) @ band.strides)
        beyond = beyond[~np.isin(beyond, known, assume_unique=True)]
        known = np.concatenate([known, beyond])
        cells = band.nodes(beyond)
        band.open(cells, 1)


def _neighbours(band: _Band, cells: Cells) -> Cells:
    """The cells beyond every face on which the values change sign."""
    dim = band.lattice.dim
    found = []
    for axis, side in itertools.product(range(dim), (0, 1)):
        corners = _offsets(dim, 2)
        values = band.at(cells, corners[corners[:, axis] == side])
        crossed = (values.min(axis=1) < 0) & (values.max(axis=1) >= 0)
        beyond = cells[crossed]
        beyond[:, axis] += 2 * side - 1
        found.append(beyond[(beyond[:, axis] >= 0) & (beyond[:, axis] < band.lattice.resolution)])
    return np.concatenate(found)


def _distinct(places: NDArray[np.intp]) -> NDArray[np.intp]:
    """Sorted, each once; several times faster than ``np.unique``, which hashes."""
    places = np.sort(places)
    return places[np.diff(places, prepend=-1) > 0]


def _offsets(dim: int, count: int) -> NDArray[np.intp]:
    """``count^dim`` nodes of a block, ``[count^dim, dim]``."""
    return np.array(list(itertools.product(range(count), repeat=dim)))


def _halving(dim: int) -> NDArray[np.float32]:
    """Weights of a block's ``2^dim`` corners at its ``3^dim`` nodes of the next level, ``[3^dim, 2^dim]``."""
    far = _offsets(dim, 3)[:, None] / 2
    weights: NDArray[np.float64] = np.where(_offsets(dim, 2), far, 1 - far).prod(axis=-1)
    return weights.astype(np.float32)


def _halves(dim: int) -> NDArray[np.intp]:
    """Which of a block's ``3^dim`` nodes are the corners of each half, ``[2^dim, 2^dim]``."""
    corners = _offsets(dim, 2)
    return (corners[:, None] + corners) @ (3 ** np.arange(dim)[::-1])


def _chunked(field: Field, points: NDArray[np.float32], progress: Progress) -> NDArray[np.float32]:
    values = np.empty(len(points), np.float32)
    for start, _ in progress.over(range(0, len(points), CHUNK)):
        values[start : start + CHUNK] = field(points[start : start + CHUNK])
    return values
