"""Frozen settings, readable from TOML.

A preset is the whole description of a training. What is here is common to all shape models; the sizes of
a model's networks and its named presets stand with the model, see :mod:`naisr_model.models.factory`.
"""

from __future__ import annotations

import dataclasses
import math
import tomllib
import typing
from dataclasses import dataclass, field
from pathlib import Path
from reprlib import repr as shortened
from typing import Annotated, Any, TypeVar

from naisr_model.errors import InputError

C = TypeVar("C")


@dataclass(frozen=True)
class Range:
    """What a number may be, both ends included; it stands beside the type of a setting.

    Attributes:
        low: the smallest.
        high: the largest.
    """

    low: float
    high: float

    def require(self, name: str, value: Any, kind: type) -> None:
        """Make sure that a value is within.

        Args:
            name: of the setting, as ``training.epochs``.
            value: that it has.
            kind: ``int`` where it has to be a whole number.

        Raises:
            InputError: when it is not, and for what is no such number.
        """
        is_number = isinstance(value, int) or (kind is float and isinstance(value, float))
        if not is_number or not self.low <= value <= self.high:
            whole = "a whole number from " if kind is int and isinstance(value, float) else ""
            given = f"give {whole}{self.low:.10g} to {self.high:.10g}"
            raise InputError(f"the setting '{name}' is {shortened(value)}; {given}")


Count = Annotated[int, Range(1, 1_000_000)]
Rate = Annotated[float, Range(1e-9, 1000)]
Weight = Annotated[float, Range(0, 1e6)]
Share = Annotated[float, Range(0, 1)]
Seed = Annotated[int, Range(0, 2**32 - 1)]


@dataclass(frozen=True)
class SirenConfig:
    """A sine MLP: one input layer, ``hidden`` hidden-to-hidden layers, one linear output layer.

    Attributes:
        width: units of every hidden layer.
        hidden: hidden-to-hidden layers; the paper's ``N_l`` counts ``hidden + 2``.
        omega0: frequency of the sines; a lower one gives a smoother function.
    """

    width: Annotated[int, Range(1, 4096)] = 256
    hidden: Annotated[int, Range(0, 64)] = 4
    omega0: Annotated[float, Range(1e-3, 1e4)] = 30.0


@dataclass(frozen=True)
class NetworkConfig:
    """What the networks of every shape model have; each model adds its own sizes.

    Attributes:
        dim: 2 for curves, 3 for surfaces.
        latent: length of the latent code z.
    """

    dim: Annotated[int, Range(2, 3)] = 3
    latent: Annotated[int, Range(1, 4096)] = 256


@dataclass(frozen=True)
class LossWeights:
    """Weights of the loss terms; lambda_1 ... lambda_6 are the paper's.

    Attributes:
        surface_eikonal: lambda_1, | |grad Phi| - 1 | on the surface.
        surface_distance: lambda_2, |Phi| on the surface.
        surface_normal: lambda_3, 1 - cos(grad Phi, n) on the surface.
        space_distance: lambda_4, |Phi - s| off the surface.
        space_eikonal: lambda_5, | |grad Phi| - 1 | off the surface.
        template_eikonal: | |grad T| - 1 | at the deformed points: the template is a distance while a
            shape, which may be the template shrunk, need not be.
        first_order: |Phi / |grad Phi| - s| off the surface, see ``losses.first_order_distance``.
        first_order_reach: model units beyond which that error counts relative to the distance.
        latent: multiplies |z|^2 / (L sigma^2), so 2 is the paper's lambda_6 = 2 / L.
        latent_sigma: sigma of the latent prior.
        centring: length of the mean over a binary covariate's two levels of its displacement at z = 0.
            The level 0 between them is never observed, so without this term that displacement could
            carry any offset common to everybody and the template would stand elsewhere.
        ridge: mean squared displacement at z = 0, which settles what the data leave open.
        folding: mean of max(0, -det(I + grad d)) at surface points; 0 leaves it out.
        underway: of what the template says after earlier steps, see ``losses.underway``.
        pointwise: length of the displacements, see ``losses.pointwise``.
        pointpair: how much displacements differ from place to place, see ``losses.pointpair``.
    """

    surface_eikonal: Weight = 10.0
    surface_distance: Weight = 30.0
    surface_normal: Weight = 10.0
    space_distance: Weight = 100.0
    space_eikonal: Weight = 10.0
    template_eikonal: Weight = 0.0
    first_order: Weight = 0.0
    first_order_reach: Annotated[float, Range(1e-6, 1e6)] = 0.1
    latent: Weight = 2.0
    latent_sigma: Annotated[float, Range(1e-6, 1e3)] = 0.01
    centring: Weight = 0.0
    ridge: Weight = 0.0
    folding: Weight = 0.0
    underway: Weight = 0.0
    pointwise: Weight = 0.0
    pointpair: Weight = 0.0


@dataclass(frozen=True)
class TrainingConfig:
    """How the networks and codes are optimised.

    Attributes:
        epochs: passes over the training shapes.
        batch_shapes: shapes in a batch.
        surface_points: on-surface points of a shape in a batch.
        near_points: off-surface points close to the surface.
        uniform_points: off-surface points uniform in the box; too few of them leave ghost surfaces.
        template_rate: Adam's learning rate for the network that gives distances, a template's or a shape's.
        displacement_rate: Adam's learning rate for the networks that move points, where there are any.
        latent_rate: Adam's learning rate for the codes.
        hidden_rate: Muon's learning rate for the matrices between hidden layers of sines, to be divided by
            their omega0; 0 leaves them to Adam.
        cosine: let the rates fall to zero along a cosine instead of staying constant.
        population_share: first part of the training, in which every code is 0, so that the
            covariates explain what they can before the codes may.
        residual_latents: project the codes on the orthogonal complement of functions of the
            covariates, so that a code cannot carry what a covariate explains.
        template_epochs: epochs at which the template is kept as a mesh or a curve.
        seed: of the initial weights and of every draw.
        loss: weights of the terms.
    """

    epochs: Count = 3000
    batch_shapes: Count = 64
    surface_points: Count = 500
    near_points: Count = 200
    uniform_points: Count = 50
    template_rate: Rate = 5e-5
    displacement_rate: Rate = 5e-5
    latent_rate: Rate = 1e-3
    hidden_rate: Annotated[float, Range(0, 1000)] = 0.0
    cosine: bool = False
    population_share: Share = 0.0
    residual_latents: bool = False
    template_epochs: tuple[Count, ...] = ()
    seed: Seed = 0
    loss: LossWeights = field(default_factory=LossWeights)

    @property
    def shape_points(self) -> int:
        """Points of one shape in a batch."""
        return self.surface_points + self.near_points + self.uniform_points


@dataclass(frozen=True)
class Preset:
    """Everything that ``naisr train`` needs to know beside the data.

    Attributes:
        model: name of the shape model, see :mod:`naisr_model.models.factory`.
        network: sizes of that model's networks, of its own kind.
        training: how they are optimised.
    """

    model: str
    network: NetworkConfig
    training: TrainingConfig


@dataclass(frozen=True)
class FitConfig:
    """The paper's procedure of fitting a code (section "Testing"), kept as the reference for the fast one.

    Attributes:
        steps: Adam steps.
        rate: Adam's learning rate.
        surface_points: on-surface points drawn at each step.
        space_points: off-surface points drawn at each step, half of them near the surface.
        seed: of the draws.
    """

    steps: Count = 800
    rate: Rate = 5e-3
    surface_points: Count = 500
    space_points: Annotated[int, Range(2, 1_000_000)] = 250
    seed: Seed = 0


def to_json(config: Any) -> dict[str, Any]:
    """A frozen config as nested plain dictionaries."""
    return dataclasses.asdict(config)


def from_json(base: C, record: dict[str, Any], where: str = "") -> C:
    """``base`` with the settings of a record that :func:`to_json` gave; keys left out stay as they are.

    Raises:
        InputError: for a key that ``base`` does not have, a value of another type or one out of range.
    """
    hints = typing.get_type_hints(type(base))
    if unknown := sorted(set(record) - set(hints)):
        raise InputError(f"unknown setting '{where}{unknown[0]}'; known are {', '.join(hints)}")
    changes = {
        key: _converted(hints[key], value, getattr(base, key), f"{where}{key}")
        for key, value in record.items()
    }
    changed: C = dataclasses.replace(base, **changes)  # type: ignore[type-var]
    require_ranges(changed, where)
    return changed


def require_ranges(config: Any, where: str = "") -> None:
    """Make sure that every setting is in the range that stands beside its type.

    Args:
        config: settings, with others within.
        where: what stands before their names in a sentence.

    Raises:
        InputError: for the first that is not.
    """
    for key, hint in typing.get_type_hints(type(config), include_extras=True).items():
        value = getattr(config, key)
        if dataclasses.is_dataclass(value):
            require_ranges(value, f"{where}{key}.")
        elif typing.get_origin(hint) is tuple:
            _require_in_range(typing.get_args(hint)[0], value, f"{where}{key}")
        else:
            _require_in_range(hint, (value,), f"{where}{key}")


def _require_in_range(hint: Any, values: tuple[Any, ...], name: str) -> None:
    for limits in getattr(hint, "__metadata__", ()):
        for value in values:
            limits.require(name, value, hint.__origin__)


def _converted(kind: Any, value: Any, base: Any, where: str) -> Any:
    """``value`` as the setting that is now ``base``, which a nested config's type is taken from."""
    if dataclasses.is_dataclass(base):
        if not isinstance(value, dict):
            raise InputError(f"setting '{where}' is {shortened(value)}; expected a table")
        return from_json(base, value, f"{where}.")
    if typing.get_origin(kind) is tuple:
        (one, _) = typing.get_args(kind)
        if not isinstance(value, list | tuple):
            raise InputError(f"setting '{where}' is {shortened(value)}; expected a list of {one.__name__}")
        return tuple(_converted(one, each, None, where) for each in value)
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value) if abs(value) < 2**1000 else math.inf
    if not isinstance(value, kind) or isinstance(value, bool) is not (kind is bool):
        raise InputError(f"setting '{where}' is {shortened(value)}; expected {kind.__name__}")
    return value


def read_toml(path: Path, base: Preset) -> Preset:
    """``base`` with the settings of a TOML file (tables ``network`` and ``training``) on top.

    Raises:
        InputError: for an unreadable file, an unknown setting, a value of the wrong type or out of range.
    """
    try:
        record = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"cannot read the settings in {path}: {error}") from error
    if (model := record.get("model", base.model)) != base.model:
        raise InputError(
            f"the settings in {path} are for the model '{model}' and the preset is for '{base.model}'; "
            "choose a preset of that model"
        )
    return from_json(base, record)
