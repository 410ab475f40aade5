"""The only grid: the nodes of cubic cells that fill the box ``[-1, 1]^dim``."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Lattice:
    """``resolution`` cells along each side, so ``resolution + 1`` nodes; x varies fastest.

    Attributes:
        resolution: cells along a side.
        dim: 2 or 3.
    """

    resolution: int
    dim: int = 3

    @property
    def spacing(self) -> float:
        """Side of a cell in model units."""
        return 2 / self.resolution

    @property
    def shape(self) -> tuple[int, ...]:
        """Nodes along (z,) y, x: the shape of an array of node values."""
        return (self.resolution + 1,) * self.dim

    def points(self, indices: NDArray[np.number]) -> NDArray[np.float32]:
        """Model coordinates (x, y[, z]) of node indices (x, y[, z]), ``[n, dim]``; halves lie between."""
        return (indices * self.spacing - 1).astype(np.float32)

    def nodes(self) -> NDArray[np.intp]:
        """Indices (x, y[, z]) of every node, ``[(resolution + 1)^dim, dim]``, x fastest."""
        grid = np.indices(self.shape).reshape(self.dim, -1)
        return np.ascontiguousarray(grid[::-1].T)
