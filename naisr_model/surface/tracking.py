"""The template's vertices carried to a shape: a surface that moves instead of being found anew.

A shape's surface is where T(p + d(p)) = 0, so the template's vertex q stands in it at the p that solves

    p + d(p) = q,    d = sum_i g_i.

With d tabulated this takes milliseconds, and every vertex keeps knowing its point of the template. Where
p -> p + d(p) folds, a shape may hold more or other pieces than the template; that is looked for.

With T tabulated too, the same d gives a guess of the shape's field that costs no network, by which its
exact surface is found sooner.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import torch
import trimesh
from numpy.typing import NDArray
from torch import Tensor

from naisr_model.covariates import Covariate, Values, complete, normalised_vector
from naisr_model.frames import Frame
from naisr_model.models.base import DeformableModel
from naisr_model.surface.displacements import SPACINGS, Displacements, DisplacementTables, jacobian, sample
from naisr_model.surface.fields import template_field
from naisr_model.surface.lattice import Lattice
from naisr_model.surface.sparse import Field, continued, evaluate_band

RESOLVED = 0.02 * 2 / 128
"""Model units within which p + d(p) must meet q: a fiftieth of a voxel of 128^3."""

LONGEST_STEP = 4 * SPACINGS[-1]
"""Of Newton's method, in model units: further on, the derivative says little."""

STEPS = 20

NEGLIGIBLE = 0.01
"""Share below which a code does not count beside another."""

TEMPLATE_LATTICE = Lattice(128)
"""Where T is tabulated."""


PointMap = Callable[[Tensor], Tensor]
"""From points ``[3, n]`` to what is there, ``[3, n]``; model units."""


@dataclass(frozen=True, eq=False)
class Tracked:
    """The template's surface carried to a shape.

    Attributes:
        points_mm: vertices, in the order of the template's, float32 ``[n, 3]``.
        normals: outward unit normals, float32 ``[n, 3]``.
        lost: share of the vertices for which no p was found.
        folds: whether the deformation folds somewhere in the region that shapes can reach: the shape may
            then differ from what is shown.
    """

    points_mm: NDArray[np.float32]
    normals: NDArray[np.float32]
    lost: float
    folds: bool

    @property
    def is_trustworthy(self) -> bool:
        """Whether this is the whole surface of the shape."""
        return not (self.folds or self.lost)


class Tracker(Protocol):
    """Carries one template surface to any covariates.

    Values are real ones by name; what is left out is at the centre, so that a single one gives Phi_i.
    All methods raise :class:`InputError` for an unknown covariate.
    """

    @property
    def faces(self) -> NDArray[np.int64]:
        """Vertex numbers of the triangles, ``[m, 3]``; the same for every shape."""

    @property
    def template_points_mm(self) -> NDArray[np.float32]:
        """The template's vertices, ``[n, 3]``, in the order in which they are carried."""

    def track(self, values: Values, start: Tracked | None = None) -> Tracked:
        """Carry the template to ``values``; from a shape nearby, ``start``, in fewer steps.

        Raises:
            InputError: also for a value out of range.
        """

    def guess(self, values: Values) -> Field:
        """T(p + d(p)) by interpolation: near the surface within a fraction of a voxel, at next to no work."""


@dataclass(frozen=True, eq=False)
class CodeTracker:
    """A :class:`Tracker` at one code.

    Attributes:
        covariates: of the atlas.
        frame: millimetres to model units.
        displacements: tabulated, of the code.
        template_points: vertices q in model units, ``[3, n]``.
        template_slopes: gradients of T there, ``[3, n]``.
        template_values: T at the nodes of a lattice over the box, ``[1, nz, ny, nx]``.
        faces: vertex numbers of the triangles, ``[m, 3]``; the same for every shape.
    """

    covariates: tuple[Covariate, ...]
    frame: Frame
    displacements: Displacements
    template_points: Tensor
    template_slopes: Tensor
    template_values: Tensor
    faces: NDArray[np.int64]

    @property
    def template_points_mm(self) -> NDArray[np.float32]:
        """As :attr:`Tracker.template_points_mm`."""
        return self.frame.to_mm(_columns(self.template_points)).astype(np.float32)

    def track(self, values: Values, start: Tracked | None = None) -> Tracked:
        """As :meth:`Tracker.track`."""
        vector = normalised_vector(self.covariates, complete(self.covariates, values))
        first = self.template_points if start is None else _rows(self.frame.to_model(start.points_mm))
        with torch.inference_mode():
            field = self.displacements.at(vector)
            slopes = jacobian(field)
            lower = self.displacements.lower
            points, bends, error = _solve(torch.cat([field, slopes]), lower, self.template_points, first)
            normals = _carried(bends, self.template_slopes)
            folds = bool((_determinant(_matrix(slopes)) <= 0).any())
        points_mm = self.frame.to_mm(_columns(points)).astype(np.float32)
        return Tracked(points_mm, _columns(normals), float((error > RESOLVED).float().mean()), folds)

    def displacement(self, values: Values) -> PointMap:
        """The sum d by interpolation; the further out of range, the worse."""
        vector = normalised_vector(self.covariates, complete(self.covariates, values, extrapolate=True))
        field, lower = self.displacements.at(vector), self.displacements.lower
        return lambda points: sample(field, lower, points)

    def guess(self, values: Values) -> Field:
        """As :meth:`Tracker.guess`."""
        return _composed(self.template_values, self.displacement(values))


@dataclass(frozen=True, eq=False)
class FadingTracker:
    """A :class:`Tracker` whose code passes from one to another with the covariates.

    The displacements are so nearly linear in the code that a shape in between stands, vertex by vertex,
    between the shapes of both codes.

    Attributes:
        far: of the code far away.
        near: of the code at home, and of the same template.
        nearness: share of the latter by real covariate values, 0 to 1.
    """

    far: CodeTracker
    near: CodeTracker
    nearness: Callable[[Values], float]

    @property
    def faces(self) -> NDArray[np.int64]:
        """As :attr:`Tracker.faces`."""
        return self.far.faces

    @property
    def template_points_mm(self) -> NDArray[np.float32]:
        """As :attr:`Tracker.template_points_mm`."""
        return self.far.template_points_mm

    def track(self, values: Values, start: Tracked | None = None) -> Tracked:
        """As :meth:`Tracker.track`."""
        share = self._share(values)
        if share in (0.0, 1.0):
            return (self.near if share else self.far).track(values, start)
        far, near = (each.track(values, start) for each in (self.far, self.near))
        normals = _between(far.normals, near.normals, share)
        return Tracked(
            _between(far.points_mm, near.points_mm, share),
            normals / np.linalg.norm(normals, axis=1, keepdims=True).clip(min=1e-12),
            lost=max(far.lost, near.lost),
            folds=far.folds or near.folds,
        )

    def guess(self, values: Values) -> Field:
        """As :meth:`Tracker.guess`."""
        share = self._share(values)
        if share in (0.0, 1.0):
            return (self.near if share else self.far).guess(values)
        far, near = self.far.displacement(values), self.near.displacement(values)
        return _composed(
            self.far.template_values, lambda points: torch.lerp(far(points), near(points), share)
        )

    def _share(self, values: Values) -> float:
        share = self.nearness(values)
        return share if share > NEGLIGIBLE else 0.0


def make_tracker(
    model: DeformableModel,
    covariates: tuple[Covariate, ...],
    frame: Frame,
    template_mm: trimesh.Trimesh,
    tables: DisplacementTables,
) -> CodeTracker:
    """A tracker of the surface ``template_mm`` of T.

    Args:
        model: whose T it is.
        covariates: of the atlas.
        frame: millimetres to model units.
        template_mm: a mesh of the zero level set of T.
        tables: of the code in question.
    """
    points = torch.as_tensor(frame.to_model(template_mm.vertices), dtype=torch.float32, device=model.device)
    located = points[None].requires_grad_()
    (slopes,) = torch.autograd.grad(model.template(located).sum(), located)
    values = continued(evaluate_band(template_field(model), TEMPLATE_LATTICE), TEMPLATE_LATTICE)
    return CodeTracker(
        covariates,
        frame,
        Displacements(tables),
        points.detach().T.cpu().contiguous(),
        slopes[0].T.cpu().contiguous(),
        torch.from_numpy(values)[None],
        np.asarray(template_mm.faces, dtype=np.int64),
    )


def _solve(field: Tensor, lower: Tensor, targets: Tensor, points: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Newton's method for p + d(p) = q, all points at once; ``field [12, ...]`` is d and its Jacobian.

    Returns:
        The points p ``[3, n]``, the Jacobian there ``[9, n]``, and how far p + d(p) is from q ``[n]``.
    """
    steps = 0
    while True:
        found = sample(field, lower, points)
        missing = targets - points - found[:3]
        error = _length(missing)
        if steps == STEPS or error.max() <= RESOLVED:
            return points, found[3:], error
        points = points + _shortened(_solved(_matrix(found[3:]), missing))
        steps += 1


def _composed(template_values: Tensor, displacement: PointMap) -> Field:
    """T(p + d(p)) with T by interpolation."""

    def field(points: NDArray[np.float32]) -> NDArray[np.float32]:
        located = _rows(points)
        landed = located + displacement(located)
        return sample(template_values, -torch.ones(3), landed, TEMPLATE_LATTICE.spacing)[0].numpy()

    return field


def _between(first: NDArray[np.float32], second: NDArray[np.float32], share: float) -> NDArray[np.float32]:
    return first + np.float32(share) * (second - first)


def _matrix(slopes: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Rows of I + grad d, each ``[3, ...]``, from the Jacobian ``[9, ...]``."""
    rows = slopes.reshape(3, 3, *slopes.shape[1:]).clone()
    for axis in range(3):
        rows[axis, axis] += 1
    return rows[0], rows[1], rows[2]


def _determinant(rows: tuple[Tensor, Tensor, Tensor]) -> Tensor:
    return (rows[0] * torch.linalg.cross(rows[1], rows[2], dim=0)).sum(dim=0)


def _solved(rows: tuple[Tensor, Tensor, Tensor], right: Tensor) -> Tensor:
    """Cramer's rule for one 3 x 3 system a point."""
    a, b, c = rows
    crossed = torch.linalg.cross(b, c, dim=0)
    determinant = (a * crossed).sum(dim=0)
    total = right[0] * crossed
    total += right[1] * torch.linalg.cross(c, a, dim=0)
    total += right[2] * torch.linalg.cross(a, b, dim=0)
    return total / determinant.clamp(min=0.05)


def _length(vectors: Tensor) -> Tensor:
    """Of vectors ``[3, n]``; torch's own norm along the first axis takes five times as long."""
    return vectors.square().sum(dim=0).sqrt()


def _shortened(step: Tensor) -> Tensor:
    return step * (LONGEST_STEP / _length(step).clamp(min=LONGEST_STEP))


def _carried(slopes: Tensor, template_normals: Tensor) -> Tensor:
    """Unit gradients of T(p + d(p)): (I + grad d)^T grad T."""
    rows = _matrix(slopes)
    bent = sum(row * part for row, part in zip(rows, template_normals, strict=True))
    assert isinstance(bent, Tensor)
    return bent / _length(bent).clamp(min=1e-12)


def _rows(points: NDArray[np.floating]) -> Tensor:
    """``[n, 3]`` as ``[3, n]``."""
    return torch.from_numpy(np.ascontiguousarray(points.T, dtype=np.float32))


def _columns(points: Tensor) -> NDArray[np.float32]:
    return np.ascontiguousarray(points.numpy().T)
