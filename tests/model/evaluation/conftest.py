"""The eggs as a synthetic population, whose truth is known at any covariates, and an atlas that names it."""

from __future__ import annotations

import dataclasses
import sys
from collections import Counter
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import NamedTuple

import numpy as np
import pytest
import trimesh
from eggs import egg

from naisr_model.checkpoint import load, save
from naisr_model.covariates import Population
from naisr_model.data import populations
from naisr_model.evaluation.metrics import compare
from naisr_model.evaluation.studies import reconstruction

LARGER = 1.02
"""Everybody is a little larger than the covariates tell."""


@dataclasses.dataclass(frozen=True)
class Visit:
    """An egg on one day."""

    subject: str
    visit: str
    values: Mapping[str, float]


class EggPeople(NamedTuple):
    """An atlas file of a synthetic population, and how much larger its people are than expected."""

    atlas: Path
    larger: float = LARGER


@pytest.fixture
def coarse(monkeypatch) -> None:
    """Small surfaces and few samples: what is measured is tested elsewhere."""
    monkeypatch.setattr(reconstruction, "RESOLUTION", 64)
    monkeypatch.setattr(reconstruction, "CHECK_RESOLUTION", 32)
    monkeypatch.setattr(reconstruction, "compare", partial(compare, samples=1000, emd_samples=50))


@pytest.fixture(scope="session")
def their_atlas(egg_atlas, tmp_path_factory) -> Path:
    """The atlas of the eggs with its first two held-out eggs of one sex as one subject's two days."""
    checkpoint = load(egg_atlas)
    population = checkpoint.population
    rows = np.flatnonzero(population.held_out)
    sexes = population.values[rows, population.names.index("sex")]
    first, second = rows[sexes == Counter(sexes).most_common(1)[0][0]][:2]
    subjects, days = list(population.subjects), list(population.visits)
    subjects[second], days[second] = subjects[first], "2"
    people = dataclasses.replace(population, subjects=tuple(subjects), visits=tuple(days))
    source = {"population": "eggs", "seed": 0, "patients": 24}
    out = tmp_path_factory.mktemp("theirs") / "eggs.safetensors"
    save(out, dataclasses.replace(checkpoint, population=people, source=source))
    return out


@pytest.fixture
def egg_people(their_atlas, monkeypatch) -> EggPeople:
    """The same atlas, once its population is among those that can be made again."""
    module = ModuleType("egg_people")
    module.__dict__.update(
        visits=partial(visits, load(their_atlas).population),
        visit_shape=lambda visit: (true_shape(visit.values).apply_scale(LARGER), {}),
        true_shape=true_shape,
        true_landmarks=lambda values: {},
        growth_path=lambda: [("age", "hens", {"age": age, "sex": -1.0}) for age in (3.0, 7.0)],
    )
    monkeypatch.setitem(sys.modules, "egg_people", module)
    known = {**populations.POPULATIONS, "eggs": "egg_people"}
    monkeypatch.setattr(populations, "POPULATIONS", MappingProxyType(known))
    return EggPeople(their_atlas)


def visits(population: Population, seed: int, patients: int) -> list[Visit]:
    """Seed 0 gives those whom the atlas is made from, any other new people."""
    if seed == 0:
        names = zip(population.subjects, population.visits, strict=True)
        return [Visit(*name, population.row(row)) for row, name in enumerate(names)]
    ages = np.random.default_rng(seed).uniform(0.5, 9.5, patients)
    values = [{"age": float(age), "sex": (-1.0, 1.0)[number % 2]} for number, age in enumerate(ages)]
    return [Visit(f"N{number}", "1", one) for number, one in enumerate(values)]


def true_shape(values: Mapping[str, float]) -> trimesh.Trimesh:
    return egg(values["age"], values["sex"])
