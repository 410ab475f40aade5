"""Tabulated displacements: what a moving slider needs in milliseconds instead of seconds.

The displacement fields g_i(p, c_i, z) of one code z are smooth in the point and in the covariate, and
they add. So each is evaluated once, on a coarse lattice at a few values of c_i, and interpolated by
cubic splines ever after. How coarse is measured on the networks, see :data:`TOLERANCE`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load_file
from safetensors.numpy import save as in_memory
from scipy.interpolate import CubicSpline
from torch import Tensor
from torch.nn import functional

from naisr_model.errors import InputError
from naisr_model.files import replacing
from naisr_model.models.base import AdditiveModel, PointFunction
from naisr_model.progress import SILENT, Progress

SPACINGS = (1 / 8, 1 / 16, 1 / 32)
"""Distances between tabulated nodes that are tried, in model units. The last is also the spacing of the
lattice that tables are refined to, on which the displacement is linear between nodes."""

KNOT_COUNTS = (3, 5, 9, 17, 33)
"""How many values of a covariate may be tabulated; each set holds the ones before."""

TOLERANCE = 0.25 * 2 / 128
"""Largest interpolation error at the probes, in model units, at which a table is fine enough: a quarter of
a voxel of 128^3."""

PROBES = 200
"""Points between the nodes at which the interpolation error is measured."""

SURVEY = 1 / 6
"""Spacing of the lattice on which the region is found that shapes can reach."""

CHUNK = 4096
"""Evaluations between two looks at whether anybody waits for them."""


@dataclass(frozen=True, eq=False)
class DisplacementTable:
    """One g_i at the nodes of a lattice and at knots of its covariate.

    Attributes:
        spacing: between nodes, model units.
        knots: centred values of the covariate, rising, ``[K]``.
        nodes: x, y, z displacements, float32 ``[K, 3, nz, ny, nx]``.
    """

    spacing: float
    knots: NDArray[np.float64]
    nodes: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class DisplacementTables:
    """The g_i of one code over the region that its shapes can reach.

    Attributes:
        region: lower and upper corner (x, y, z) in model units, ``[2, 3]``; every lattice begins at the
            lower one.
        tables: one a covariate, in the order of the covariates.
    """

    region: NDArray[np.float64]
    tables: tuple[DisplacementTable, ...]

    def save(self, path: Path) -> None:
        """Write the tables as a ``.safetensors`` file, in one step."""
        arrays: dict[str, NDArray] = {"region": self.region}
        for index, table in enumerate(self.tables):
            arrays[f"{index}.spacing"] = np.array([table.spacing])
            arrays[f"{index}.knots"], arrays[f"{index}.nodes"] = table.knots, table.nodes
        # The writer takes what lies in memory, strides or not.
        packed = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
        with replacing(path) as temporary:
            temporary.write_bytes(in_memory(packed))

    @classmethod
    def load(cls, path: Path) -> DisplacementTables:
        """Read what :meth:`save` wrote.

        Raises:
            InputError: when there is no such file or it holds something else.
        """
        try:
            arrays = load_file(path)
            tables = tuple(
                DisplacementTable(
                    float(arrays[f"{index}.spacing"][0]), arrays[f"{index}.knots"], arrays[f"{index}.nodes"]
                )
                for index in range(len(arrays) // 3)
            )
            _require_sound(arrays["region"], tables)
            return cls(arrays["region"], tables)
        except (SafetensorError, OSError, KeyError, IndexError, ValueError) as error:
            raise InputError(f"{path} does not hold tabulated displacements ({error})") from error


def _require_sound(region: NDArray[np.float64], tables: tuple[DisplacementTable, ...]) -> None:
    """Make sure that tables can be interpolated in: whoever does asks no more.

    Raises:
        ValueError: when they cannot.
    """
    if region.shape != (2, 3) or not np.isfinite(region).all():
        raise ValueError("its region is none")
    for table in tables:
        knots, nodes = table.knots, table.nodes
        if not table.spacing > 0 or knots.ndim != 1 or not (np.diff(knots) > 0).all():
            raise ValueError("its knots do not rise")
        if nodes.ndim != 5 or nodes.shape[:2] != (len(knots), 3) or not np.isfinite(nodes).all():
            raise ValueError("its displacements are none")


def tabulate(
    model: AdditiveModel,
    ranges: Sequence[tuple[float, float]],
    latent: Tensor,
    bounds: NDArray[np.float64],
    *,
    progress: Progress = SILENT,
) -> DisplacementTables:
    """Tabulate every g_i of a code.

    Args:
        model: trained, of 3D shapes.
        ranges: lowest and highest centred value of each covariate.
        latent: the code z, ``[L]``.
        bounds: lower and upper corner of the template's surface in model units, ``[2, 3]``.
        progress: told the finished share, checked between chunks of points.

    Raises:
        Cancelled: when nobody waits for it any more.
    """
    fields = [_field(model, index, latent, progress) for index in range(len(ranges))]
    region = _reachable(fields, ranges, bounds)
    jobs = list(zip(fields, ranges, strict=True))
    tables = tuple(_tabulated(*job, region) for job, _ in progress.over(jobs))
    return DisplacementTables(region, tables)


class Displacements:
    """Sums of tabulated displacements, linear between the nodes of one fine lattice.

    Args:
        tables: of one code.

    Attributes:
        lower: the first node of that lattice, (x, y, z) in model units.
    """

    def __init__(self, tables: DisplacementTables) -> None:
        self.lower = torch.as_tensor(tables.region[0], dtype=torch.float32)
        self._knots = [table.knots for table in tables.tables]
        self._nodes = [torch.from_numpy(_refined(table, tables.region)) for table in tables.tables]
        self._latest: dict[int, tuple[float, Tensor]] = {}

    def at(self, covariates: Sequence[float] | NDArray[np.float64]) -> Tensor:
        """sum_i g_i(., c_i) at all nodes, ``[3, nz, ny, nx]``; the N ``covariates`` are centred.

        A covariate at exactly 0 adds exactly nothing.
        """
        total = torch.zeros_like(self._nodes[0][0])
        for index, value in enumerate(covariates):
            if value != 0:
                total += self._of(index, float(value))
        return total

    def _of(self, index: int, value: float) -> Tensor:
        """g_i at all nodes; the last is kept, since most covariates stay where they are."""
        latest = self._latest.get(index)  # another thread may be about to replace it
        if latest is None or latest[0] != value:
            (weights,) = _spline_weights(self._knots[index], np.array([value]))
            field = torch.tensordot(torch.from_numpy(weights), self._nodes[index], dims=1)
            self._latest[index] = latest = (value, field)
        return latest[1]


def sample(field: Tensor, lower: Tensor, points: Tensor, spacing: float = SPACINGS[-1]) -> Tensor:
    """A field on a lattice, ``[C, nz, ny, nx]``, linearly interpolated at points: ``[C, n]``.

    Args:
        field: values at the nodes.
        lower: first node, (x, y, z) in model units.
        points: ``[3, n]`` model units; outside the lattice the value at its edge is taken.
        spacing: between nodes, model units.
    """
    cells = torch.tensor(field.shape[:0:-1]) - 1  # along x, y, z
    place = (points - lower[:, None]) * (2 / (spacing * cells[:, None])) - 1
    found = functional.grid_sample(
        field[None], place.T[None, None, None], padding_mode="border", align_corners=True
    )
    return found[0, :, 0, 0]


def jacobian(field: Tensor) -> Tensor:
    """Central differences of :meth:`Displacements.at`, ``[9, nz, ny, nx]``: d_x by x, y, z, then d_y, d_z."""
    along_z, along_y, along_x = torch.gradient(field, spacing=SPACINGS[-1], dim=(1, 2, 3))
    return torch.stack([along_x, along_y, along_z], dim=1).flatten(0, 1)


_Values = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float32]]
"""Points ``[n, 3]`` and centred values ``[K]`` of one covariate to displacements ``[K, 3, n]``."""


def _field(model: AdditiveModel, index: int, latent: Tensor, progress: Progress) -> _Values:
    """g_i of the covariate ``index`` at one code."""

    def field(points: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float32]:
        effect = model.effect_function(index, torch.as_tensor(values, dtype=torch.float32), latent)
        located = torch.as_tensor(points, dtype=torch.float32, device=model.device)
        pieces = located.split(max(1, CHUNK // (len(values) + 1)))
        return np.concatenate([chunk(effect, piece) for piece in pieces], axis=-1)

    def chunk(effect: PointFunction, points: Tensor) -> NDArray[np.float32]:
        progress.check()
        return effect(points).mT.numpy(force=True)

    return field


def _reachable(
    fields: Sequence[_Values], ranges: Sequence[tuple[float, float]], bounds: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Corners ``[2, 3]`` of a region outside which no point is carried onto the template's surface.

    While c_i runs through its range, g_i at a node runs through an interval along each axis. A node is
    left out where the sum of the intervals, a survey spacing widened, misses the template's bounds.
    """
    nodes = _lattice(np.array([[-1.0] * 3, [1.0] * 3]), SURVEY).reshape(3, -1)
    low, high = nodes - SURVEY, nodes + SURVEY
    for field, limits in zip(fields, ranges, strict=True):
        displacements = field(nodes.T, np.linspace(*limits, KNOT_COUNTS[1]))
        low, high = low + displacements.min(axis=0), high + displacements.max(axis=0)
    meets = (high >= bounds[0][:, None]) & (low <= bounds[1][:, None])
    near = np.concatenate([nodes[:, meets.all(axis=0)], bounds.T], axis=1)
    return np.stack([near.min(axis=1), near.max(axis=1)])


def _tabulated(field: _Values, limits: tuple[float, float], region: NDArray[np.float64]) -> DisplacementTable:
    """The coarsest table whose interpolation is within :data:`TOLERANCE` at the probes."""
    probes = np.random.default_rng(0).uniform(region[0], region[1], (PROBES, 3))
    values = np.linspace(*limits, KNOT_COUNTS[-1])
    truth = field(probes, values)
    ends = [0, -1]
    spacing = next(
        (
            s
            for s in SPACINGS[:-1]
            if _spatial_error(field, region, s, probes, values[ends], truth[ends]) <= TOLERANCE
        ),
        SPACINGS[-1],
    )
    knots = values[:: _knot_step(values, truth)]
    return DisplacementTable(spacing, knots, _nodes(field, region, spacing, knots))


def _nodes(
    field: _Values, region: NDArray[np.float64], spacing: float, values: NDArray[np.float64]
) -> NDArray[np.float32]:
    points = _lattice(region, spacing)
    return field(points.reshape(3, -1).T, values).reshape(len(values), *points.shape)


def _lattice(region: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
    """Coordinates of nodes that begin at the region's lower corner and cover it, ``[3, nz, ny, nx]``."""
    axes = [
        lower + spacing * np.arange(count)
        for lower, count in zip(region[0], _counts(region, spacing), strict=True)
    ]
    z, y, x = np.meshgrid(*axes[::-1], indexing="ij")
    return np.stack([x, y, z])


def _counts(region: NDArray[np.float64], spacing: float) -> list[int]:
    """Nodes along x, y, z."""
    return [int(np.ceil(side / spacing - 1e-9)) + 1 for side in region[1] - region[0]]


def _knot_step(values: NDArray[np.float64], truth: NDArray[np.float32]) -> int:
    """The largest step through ``values`` at which a spline through every step-th is within tolerance."""
    steps = [(len(values) - 1) // (count - 1) for count in KNOT_COUNTS[:-1]]
    errors = (np.abs(CubicSpline(values[::step], truth[::step])(values) - truth).max() for step in steps)
    return next((step for step, error in zip(steps, errors, strict=True) if error <= TOLERANCE), 1)


def _spatial_error(
    field: _Values,
    region: NDArray[np.float64],
    spacing: float,
    probes: NDArray[np.float64],
    values: NDArray[np.float64],
    truth: NDArray[np.float32],
) -> float:
    """Largest error at the probes of a table of this spacing, at its own knots."""
    table = DisplacementTable(spacing, values, _nodes(field, region, spacing, values))
    fine = torch.from_numpy(_refined(table, region)).flatten(0, 1)
    lower, places = (torch.as_tensor(part, dtype=torch.float32) for part in (region[0], probes.T))
    found = sample(fine, lower, places)
    return float(np.abs(found.numpy().reshape(truth.shape) - truth).max())


def _refined(table: DisplacementTable, region: NDArray[np.float64]) -> NDArray[np.float32]:
    """The nodes of the finest lattice by cubic splines along each axis, ``[K, 3, nz, ny, nx]``."""
    along_x, along_y, along_z = (
        _spline_weights(np.arange(coarse) * table.spacing, np.arange(fine) * SPACINGS[-1])
        for coarse, fine in zip(table.nodes.shape[:1:-1], _counts(region, SPACINGS[-1]), strict=True)
    )
    nodes = along_y @ (table.nodes @ along_x.T)
    slices = along_z @ nodes.reshape(*nodes.shape[:3], -1)
    return slices.reshape(*slices.shape[:3], *nodes.shape[3:])


def _spline_weights(places: NDArray[np.floating], wanted: NDArray[np.floating]) -> NDArray[np.float32]:
    """What values at ``places [n]`` count in the cubic spline through them at ``wanted [m]``, ``[m, n]``."""
    return CubicSpline(places, np.eye(len(places)))(wanted).astype(np.float32)
