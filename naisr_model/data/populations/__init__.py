"""Synthetic populations with known effects, by name; each module is imported when it is asked for.

A population module offers ``visits(seed, patients)``, ``visit_shape(visit)``, ``true_shape(values)``,
``true_landmarks(values)``, ``growth_path()`` and
``write_population(out, *, seed, patients, progress)``, see :class:`PopulationModule`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Protocol, cast

from naisr_model.errors import InputError
from naisr_model.progress import SILENT, Progress

if TYPE_CHECKING:  # the help of a command names the populations, and needs no meshes
    from naisr_model.data.align import Landmarks
    from naisr_model.shapes.kinds import Shape

POPULATIONS = MappingProxyType(
    {
        "airway": "naisr_model.data.populations.airway",
        "bodies": "naisr_model.data.populations.bodies",
        "starman": "naisr_model.data.populations.starman",
    }
)
"""Module of each population; importing this package imports none of them."""


class PopulationVisit(Protocol):
    """One person seen once; ``(subject, visit)`` is unique."""

    @property
    def subject(self) -> str:
        """The person."""

    @property
    def visit(self) -> str:
        """Which of the person's visits."""

    @property
    def values(self) -> Mapping[str, float]:
        """Covariates in real units by name."""


class PopulationModule(Protocol):
    """What the module of a population offers; shapes and landmarks are in millimetres."""

    def visits(self, seed: int, patients: int = ...) -> Sequence[PopulationVisit]:
        """Everybody in order; the same seed gives the same people."""

    def visit_shape(self, visit: Any) -> tuple[Shape, Landmarks]:
        """The shape and the landmarks of one of :meth:`visits`."""

    def true_shape(self, values: Mapping[str, float]) -> Shape:
        """The shape without individual variation."""

    def true_landmarks(self, values: Mapping[str, float]) -> Landmarks:
        """The landmarks of :meth:`true_shape`; empty where the population needs none."""

    def growth_path(self) -> list[tuple[str, str, dict[str, float]]]:
        """Where to compare with the truth: the covariate that moves, a condition, all values."""

    def write_population(
        self,
        out: Path,
        *,
        seed: int,
        patients: int = ...,
        progress: Progress = SILENT,
    ) -> Path:
        """Write meshes and a table into ``out``; returns the path of the table."""


MOST_PATIENTS = 100_000
"""Of one synthetic population."""


def require_size(seed: int, patients: int) -> None:
    """Make sure that a population of this seed and size can be made.

    Raises:
        InputError: when there is nobody, there are too many, or the seed is none.
    """
    if not 1 <= patients <= MOST_PATIENTS:
        raise InputError(f"{patients} patients were asked for; give at least 1, at most {MOST_PATIENTS}")
    if not 0 <= seed < 2**32:
        raise InputError(f"the seed is {seed}; give 0 or more, up to {2**32 - 1}")


def require_own(out: Path, name: str) -> None:
    """Make sure that a folder holds no table but one of the same population, which writing it replaces.

    Raises:
        InputError: when it does, or is a file.
    """
    if out.exists() and not out.is_dir():
        raise InputError(f"'{out}' is a file; give the name of a folder to write into")
    if any((out / file).exists() for file in ("data.csv", "data.toml")) and _population_in(out) != name:
        raise InputError(f"{out} holds a table of something else; give another folder")


def _population_in(folder: Path) -> str | None:
    try:
        return str(tomllib.loads((folder / "data.toml").read_text(encoding="utf-8"))["source"]["population"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def population(name: str) -> PopulationModule:
    """The module of a population.

    Raises:
        InputError: for an unknown name.
    """
    if name not in POPULATIONS:
        raise InputError(f"unknown population '{name}'; known are {', '.join(sorted(POPULATIONS))}")
    return cast(PopulationModule, import_module(POPULATIONS[name]))
