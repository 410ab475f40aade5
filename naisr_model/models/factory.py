"""Shape models by name; the module of each is imported when it is asked for.

The module of a model offers ``MODEL`` and ``PRESETS``, see :class:`ModelModule`.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from types import MappingProxyType
from typing import Any, Protocol, cast

import torch

from naisr_model.config import Preset, TrainingConfig, from_json
from naisr_model.errors import InputError
from naisr_model.models.base import ShapeModel

MODELS = MappingProxyType(
    {
        "naisr": "naisr_model.models.naisr",
        "deepsdf": "naisr_model.models.deepsdf",
        "asdf": "naisr_model.models.asdf",
        "dit": "naisr_model.models.dit",
        "ndf": "naisr_model.models.ndf",
        "joint": "naisr_model.models.joint",
        "invertible": "naisr_model.models.invertible",
    }
)
"""Module of each model; importing this one imports none of them."""

UNNAMED = "naisr"
"""The model of a record that names none: it was written when there was no other."""


MOST_WEIGHTS = 200_000_000
"""A hundred times as many as at the paper's size."""


class ModelModule(Protocol):
    """What the module of a model offers."""

    @property
    def MODEL(self) -> type[ShapeModel]:
        """Its class."""

    @property
    def PRESETS(self) -> Mapping[str, Preset]:
        """Its trainings; a name is given once among all models."""


def model_class(name: str) -> type[ShapeModel]:
    """The class of a model.

    Raises:
        InputError: for an unknown name.
    """
    return _module(name).MODEL


def build(preset: Preset, covariates: int) -> ShapeModel:
    """A model with new weights.

    Args:
        preset: names the model and the sizes of its networks.
        covariates: how many were measured; a model that is not evolvable has no use for them.

    Raises:
        InputError: for an unknown model.
    """
    return model_class(preset.model)(preset.network, covariates)


def layout(preset: Preset, covariates: int) -> dict[str, tuple[int, ...]]:
    """Shapes of a model's weights by name, found without making them.

    Args:
        preset: names the model and the sizes of its networks.
        covariates: how many were measured.

    Raises:
        InputError: for an unknown model, or one of more than :data:`MOST_WEIGHTS`.
    """
    with torch.device("meta"):
        weights = build(preset, covariates).state_dict()
    if (count := sum(weight.numel() for weight in weights.values())) > MOST_WEIGHTS:
        raise InputError(
            f"the networks have {count:.2g} weights, more than {MOST_WEIGHTS:g}; give smaller widths, fewer "
            "layers or a shorter latent code"
        )
    return {name: tuple(weight.shape) for name, weight in weights.items()}


def presets() -> dict[str, Preset]:
    """The presets of all models by name.

    Raises:
        ValueError: when two models give the same name to theirs.
    """
    listed = [(name, preset) for model in MODELS for name, preset in _module(model).PRESETS.items()]
    names = [name for name, _ in listed]
    if twice := {name for name in names if names.count(name) > 1}:
        raise ValueError(f"two models have a preset called {' and '.join(sorted(twice))}")
    return dict(listed)


def preset(name: str) -> Preset:
    """The preset called ``name``.

    Raises:
        InputError: when there is none.
    """
    known = presets()
    if name not in known:
        raise InputError(f"there is no preset '{name}'; choose one of {', '.join(known)}")
    return known[name]


def model_of(record: Mapping[str, Any]) -> str:
    """Name of the model of a preset's record, known or not."""
    return str(record.get("model", UNNAMED))[:60]


def read_preset(record: dict[str, Any]) -> Preset:
    """The preset of a record that ``config.to_json`` gave; settings left out have the model's defaults.

    Raises:
        InputError: for an unknown model, an unknown setting or a value of the wrong type.
    """
    name = model_of(record)
    return from_json(Preset(name, model_class(name).settings(), TrainingConfig()), record)


def _module(name: str) -> ModelModule:
    if name not in MODELS:
        raise InputError(f"unknown shape model '{name}'; known are {', '.join(sorted(MODELS))}")
    return cast(ModelModule, import_module(MODELS[name]))
