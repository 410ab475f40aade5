"""``Atlas``: a trained population of shapes, in real units and millimetres.

>>> atlas = Atlas.load("resources/airway.safetensors")            # doctest: +SKIP
>>> boy = atlas.shape({"age": 120, "weight": 34, "sex": +1})      # doctest: +SKIP
>>> boy.volume / 1000                                             # cm3  # doctest: +SKIP
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
import trimesh
from numpy.typing import ArrayLike, NDArray
from torch import Tensor

from naisr_model.checkpoint import Checkpoint, load
from naisr_model.covariates import Covariate, Population, Values, complete, normalised_vector
from naisr_model.errors import InputError
from naisr_model.frames import Frame
from naisr_model.surface.fields import distances, effect_field, shape_field, template_field
from naisr_model.surface.isosurface import isosurface
from naisr_model.surface.lattice import Lattice
from naisr_model.surface.sparse import CHUNK, COARSEST, Field, evaluate_band

Progress = Callable[[float], None]
StopCheck = Callable[[], bool]


class Atlas:
    """A trained atlas, answering in real units.

    Everywhere, ``covariates`` maps names to values in real units (``{"age": 120}`` in the unit of
    ``atlas.covariates``; a binary covariate is -1 or +1, or between them); what is left out is at
    the population centre. ``latent`` is a code z ``[L]``; left out, it is 0, the population
    average. Surfaces are ``trimesh.Trimesh`` in millimetres with outward faces, so their
    ``volume / 1000`` is in cm3; where no surface exists they have no faces. ``resolution`` is the
    number of cells along a side of the box, a multiple of 8. A ``should_stop`` that turns true ends
    a computation with :class:`~naisr_model.errors.Cancelled`.

    Inference has no randomness: the same question has the same answer.
    """

    def __init__(self, checkpoint: Checkpoint) -> None:
        self.checkpoint = checkpoint
        self._network = checkpoint.network().requires_grad_(False)

    @classmethod
    def load(cls, path: str | Path) -> Atlas:
        """Read an atlas from a ``.safetensors`` file.

        Raises:
            InputError: when the file is missing, damaged, foreign or too new.
        """
        return cls(load(path))

    @property
    def name(self) -> str:
        """Name of the population, for example ``airway``."""
        return self.checkpoint.name

    @property
    def population(self) -> Population:
        """Whom the atlas was made from, with their covariates in real units."""
        return self.checkpoint.population

    @property
    def covariates(self) -> tuple[Covariate, ...]:
        """The covariates, each with name, unit, kind and observed range."""
        return self.population.covariates

    @property
    def frame(self) -> Frame:
        """Millimetres to the networks' box."""
        return self.checkpoint.frame

    def sdf(
        self,
        points_mm: ArrayLike,
        covariates: Values,
        latent: ArrayLike | None = None,
        *,
        extrapolate: bool = False,
    ) -> NDArray[np.float64]:
        """Signed distance of points to the full shape, Phi / |grad Phi|.

        That is the distance to first order: exact on the surface, an estimate away from it.

        Args:
            points_mm: ``[n, dim]``.
            covariates: real values by name.
            latent: code z ``[L]``.
            extrapolate: allow values outside the observed range.

        Returns:
            Millimetres, negative inside, ``[n]``.

        Raises:
            InputError: for an unknown covariate or one out of range.
        """
        points = self.frame.to_model(points_mm).astype(np.float32).reshape(-1, self.frame.dim)
        vector, code = self._vector(covariates, extrapolate), self._latent(latent)
        chunks = [
            distances(self._network, points[start : start + CHUNK], vector, code)
            for start in range(0, len(points), CHUNK)
        ]
        return np.concatenate([np.zeros(0), *chunks]) * self.frame.scale_mm

    def shape(
        self,
        covariates: Values,
        latent: ArrayLike | None = None,
        resolution: int = 128,
        *,
        extrapolate: bool = False,
        progress: Progress | None = None,
        should_stop: StopCheck | None = None,
    ) -> trimesh.Trimesh:
        """The full shape, the zero level set of Phi(p, c, z) = T(p + sum_i g_i(p, c_i, z)).

        Raises:
            InputError: for an unknown covariate or one out of range (unless ``extrapolate``).
            Cancelled: when ``should_stop()`` turned true.
        """
        field = shape_field(self._network, self._vector(covariates, extrapolate), self._latent(latent))
        return self._surface(field, resolution, progress, should_stop)

    def effect(
        self,
        name: str,
        value: float,
        latent: ArrayLike | None = None,
        resolution: int = 128,
        *,
        extrapolate: bool = False,
        progress: Progress | None = None,
        should_stop: StopCheck | None = None,
    ) -> trimesh.Trimesh:
        """The disentangled shape of one covariate, Phi_i(p, c_i, z) = T(p + g_i(p, c_i, z)).

        The displacements of several covariates add at one query point; these surfaces do not.

        Raises:
            InputError: for an unknown covariate or one out of range (unless ``extrapolate``).
            Cancelled: when ``should_stop()`` turned true.
        """
        vector = self._vector({name: value}, extrapolate)
        index = self.population.names.index(name)
        field = effect_field(self._network, index, vector, self._latent(latent))
        return self._surface(field, resolution, progress, should_stop)

    def template(
        self,
        resolution: int = 128,
        *,
        progress: Progress | None = None,
        should_stop: StopCheck | None = None,
    ) -> trimesh.Trimesh:
        """The template, the zero level set of T: the shape at the population centre.

        Raises:
            Cancelled: when ``should_stop()`` turned true.
        """
        return self._surface(template_field(self._network), resolution, progress, should_stop)

    def _vector(self, covariates: Values, extrapolate: bool) -> Tensor:
        values = complete(self.covariates, covariates, extrapolate=extrapolate)
        return torch.as_tensor(normalised_vector(self.covariates, values), dtype=torch.float32)

    def _latent(self, latent: ArrayLike | None) -> Tensor:
        length = self.checkpoint.preset.network.latent
        if latent is None:
            return torch.zeros(length)
        code = torch.as_tensor(np.asarray(latent, dtype=np.float32))
        if code.shape != (length,):
            raise InputError(f"the latent code has shape {tuple(code.shape)}; this atlas needs ({length},)")
        return code

    def _surface(
        self, field: Field, resolution: int, progress: Progress | None, should_stop: StopCheck | None
    ) -> trimesh.Trimesh:
        if self.frame.dim != 3:
            raise InputError("surfaces are made of 3D atlases; this one holds curves in the plane")
        if resolution < 2 * COARSEST or resolution % COARSEST:
            raise InputError(
                f"resolution is {resolution}; give a multiple of {COARSEST} from {2 * COARSEST} on"
            )
        lattice = Lattice(resolution)
        return isosurface(evaluate_band(field, lattice, progress, should_stop), lattice, self.frame)
