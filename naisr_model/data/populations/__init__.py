"""Synthetic populations with known effects, by name; each module is imported when it is asked for.

A population module offers ``true_shape(values)``, ``true_landmarks(values)`` and
``write_population(out, *, seed, patients, progress, should_stop)``.
"""

from __future__ import annotations

from importlib import import_module
from types import MappingProxyType, ModuleType

from naisr_model.errors import InputError

POPULATIONS = MappingProxyType(
    {
        "airway": "naisr_model.data.populations.airway",
        "bodies": "naisr_model.data.populations.bodies",
    }
)
"""Module of each population; importing this package imports none of them."""


def population(name: str) -> ModuleType:
    """The module of a population.

    Raises:
        InputError: for an unknown name.
    """
    if name not in POPULATIONS:
        raise InputError(f"unknown population '{name}'; known are {', '.join(sorted(POPULATIONS))}")
    return import_module(POPULATIONS[name])
