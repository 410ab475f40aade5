"""What every shape model answers, and what only some can.

Classes here are abstract, those of the models final: a method is either left open here or settled here,
never both. A new model is one file beside this one and one line in :mod:`naisr_model.models.factory`.

Everywhere, ``points [shapes, n, dim]`` are in model units, ``covariates [shapes, N]`` centred (0 is the
population centre), ``latents [shapes, L]`` codes, of which 0 is the average; N is 0 for a model that
depends on no covariates.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar, NamedTuple, final

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor, nn

from naisr_model.capabilities import Capabilities
from naisr_model.config import NetworkConfig
from naisr_model.covariates import Population
from naisr_model.errors import InputError
from naisr_model.models.siren import SirenStack

PointFunction = Callable[[Tensor], Tensor]
"""Of points ``[n, dim]`` in model units, on the device and in the precision of the model."""


class Linearised(NamedTuple):
    """A field and its derivatives, model units.

    Attributes:
        values: Phi, ``[shapes, n]``.
        slope: grad Phi with respect to the points, ``[shapes, n, dim]``.
        template_slope: grad T at the deformed points, ``[shapes, n, dim]``; None without a template.
        displacement: d, ``[shapes, n, dim]``; None without a template.
        underway: T where the points are after each of some earlier steps, ``[steps, shapes, n]``; None of a
            model that takes none.
    """

    values: Tensor
    slope: Tensor
    template_slope: Tensor | None = None
    displacement: Tensor | None = None
    underway: Tensor | None = None


class ShapeModel(nn.Module, ABC):
    """A family of shapes, one for each code and covariates.

    A model is made of its settings and of the number of covariates that were measured.

    Attributes:
        title: as people call the model.
        capabilities: what it can do.
        settings: the kind of its ``config``.
        config: sizes of its networks.
    """

    title: ClassVar[str]
    capabilities: ClassVar[Capabilities]
    settings: ClassVar[type[NetworkConfig]]
    config: NetworkConfig

    @final
    @property
    def device(self) -> torch.device:
        """Where the weights are."""
        return next(self.parameters()).device

    @final
    def tensor(self, values: ArrayLike) -> Tensor:
        """``values`` as the networks take them: in single precision, where the weights are."""
        return torch.as_tensor(np.asarray(values, dtype=np.float32)).to(self.device)

    @final
    @classmethod
    def relevant(cls, population: Population) -> Population:
        """A population with only those of its covariates that the model depends on: all or none."""
        return population if cls.capabilities.evolvable else population.keeping(())

    @abstractmethod
    def forward(self, points: Tensor, covariates: Tensor, latents: Tensor) -> Tensor:
        """Phi, the signed distance, ``[shapes, n]`` model units, negative inside."""

    @abstractmethod
    def linearised(self, points: Tensor, covariates: Tensor, latents: Tensor) -> Linearised:
        """Phi and its slope as a loss needs them: one backward pass through them, not one through another."""

    @abstractmethod
    def shape_function(self, covariates: Tensor, latent: Tensor) -> PointFunction:
        """Phi of one shape, ``[n]``, without gradients and as fast as it can be had.

        Args:
            covariates: ``[N]``.
            latent: ``[L]``.
        """

    @final
    def hidden_layers(self) -> list[tuple[nn.Parameter, float]]:
        """The matrices between hidden layers of sines, and omega0 of those sines."""
        stacks = [part for part in self.modules() if isinstance(part, SirenStack)]
        return [(stack.hidden_weight, stack.omega0) for stack in stacks]

    @abstractmethod
    def rated_parameters(self) -> dict[str, list[nn.Parameter]]:
        """All parameters, by the setting of ``TrainingConfig`` that is their learning rate."""


class DeformableModel(ShapeModel, ABC):
    """Phi(p, c, z) = T(p + d(p, c, z)): a template met at points that were moved.

    The displacements live at points of the shape and lead to the template.
    """

    @abstractmethod
    def template(self, points: Tensor) -> Tensor:
        """T, the template's signed distance, ``[shapes, n]``."""

    @abstractmethod
    def displacement(self, points: Tensor, covariates: Tensor, latents: Tensor) -> Tensor:
        """The whole displacement d, ``[shapes, n, dim]``."""

    @final  # type: ignore[misc] # to torch it is an attribute that may be set
    def forward(self, points: Tensor, covariates: Tensor, latents: Tensor) -> Tensor:
        """As :meth:`ShapeModel.forward`."""
        return self.template(points + self.displacement(points, covariates, latents))


class DisentangledModel(DeformableModel, ABC):
    """Each covariate has a displacement g_i(p, c_i, z) of its own, which vanishes at c_i = 0."""

    @abstractmethod
    def displacements(self, points: Tensor, covariates: Tensor, latents: Tensor) -> Tensor:
        """All g_i, ``[N, shapes, n, dim]``; 0 to rounding where c_i = 0."""


class AdditiveModel(DisentangledModel, ABC):
    """d = sum_i g_i(p, c_i, z)."""

    @abstractmethod
    def effect_function(self, index: int, values: Tensor, latent: Tensor) -> PointFunction:
        """g_i of one covariate at several of its values, ``[K, n, dim]``, without gradients.

        Args:
            index: i.
            values: of c_i, centred, ``[K]``.
            latent: z, ``[L]``.
        """

    @final
    def displacement(self, points: Tensor, covariates: Tensor, latents: Tensor) -> Tensor:
        """As :meth:`DeformableModel.displacement`."""
        return self.displacements(points, covariates, latents).sum(dim=0)


def deformable(model: ShapeModel) -> DeformableModel:
    """``model``, known to deform a template.

    Raises:
        InputError: when it does not.
    """
    if isinstance(model, DeformableModel):
        return model
    raise InputError(f"{model.title} deforms no template, which this needs; ask for the shape itself")


def disentangled(model: ShapeModel) -> DisentangledModel:
    """``model``, known to give each covariate a displacement of its own.

    Raises:
        InputError: when it does not.
    """
    if isinstance(model, DisentangledModel):
        return model
    raise InputError(
        f"{model.title} gives the covariates no displacements of their own, which this needs; "
        "ask for the shape itself"
    )


def additive(model: ShapeModel) -> AdditiveModel:
    """``model``, known to add up the displacements of its covariates.

    Raises:
        InputError: when it does not.
    """
    if isinstance(model, AdditiveModel):
        return model
    raise InputError(
        f"{disentangled(model).title} does not add up the displacements of the covariates, which this needs; "
        "ask for the shape itself"
    )
