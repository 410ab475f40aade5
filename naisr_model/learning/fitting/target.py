"""A patient's shape as the fit sees it: points and how far from the surface they are, in model units."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor

from naisr_model.data.samples import sample_shape
from naisr_model.data.sound import is_closed
from naisr_model.errors import InputError
from naisr_model.frames import Frame
from naisr_model.shapes.kinds import SHAPES, Shape

SURFACE_SAMPLES, NEAR_SAMPLES = 12_000, 6_000
FEWEST_POINTS = 30

SPACE_SHARE = 0.25
"""Points off the surface for each one on it, where the target says what is inside: they keep the shape from
turning inside out and surfaces away that the patient does not have."""


@dataclass(frozen=True, eq=False)
class Target:
    """Samples of one shape in model units, float32, in random order.

    Attributes:
        surface: points on the surface, ``[n, dim]``.
        space: points near it with their signed distances, ``[m, dim + 1]``; none where the surface is
            open or a cloud of points, which say nothing of inside and outside.
    """

    surface: NDArray[np.float32]
    space: NDArray[np.float32]


def target_of(shape: Shape | ArrayLike, frame: Frame, seed: int = 0) -> Target:
    """Sample a mesh, watertight or open, or a curve, or take points; in millimetres of the atlas frame.

    Raises:
        InputError: when there are too few points or coordinates that are no numbers.
    """
    mesh = shape if isinstance(shape, SHAPES) else None
    points_mm = np.asarray(shape if mesh is None else mesh.vertices, dtype=np.float64)
    if points_mm.ndim != 2 or points_mm.shape[1] != frame.dim:
        raise InputError(f"the points have shape {points_mm.shape}; give [n, {frame.dim}] in millimetres")
    if len(points_mm) < FEWEST_POINTS or not np.isfinite(points_mm).all():
        raise InputError(
            f"the shape has {len(points_mm)} points, or some not finite; give at least {FEWEST_POINTS}"
        )
    if mesh is None or not len(mesh.faces):
        order = np.random.default_rng(seed).permutation(len(points_mm))
        surface = frame.to_model(points_mm[order]).astype(np.float32)
        return Target(surface, np.zeros((0, frame.dim + 1), np.float32))
    near = NEAR_SAMPLES if is_closed(mesh) else 0
    samples = sample_shape(mesh, frame, SURFACE_SAMPLES, near, 0, seed)
    return Target(samples.surface[:, : frame.dim], samples.near)


class Sample(NamedTuple):
    """Points ``[n, dim]`` and their true distances to the surface ``[n]``, model units."""

    points: Tensor
    distances: Tensor


def draw_sample(target: Target, points: int, seed: int) -> Sample:
    """``points`` surface points, or all there are, and their share of points off the surface."""
    rng, dim = np.random.default_rng(seed), target.surface.shape[1]
    surface = target.surface[rng.permutation(len(target.surface))[:points]]
    space = target.space[rng.permutation(len(target.space))[: int(SPACE_SHARE * len(surface))]]
    return Sample(
        torch.as_tensor(np.concatenate([surface, space[:, :dim]])),
        torch.as_tensor(np.concatenate([np.zeros(len(surface), np.float32), space[:, dim]])),
    )
