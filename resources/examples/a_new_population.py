"""A synthetic population with known effects: long bones, written as a hospital would hand them over.

This file is a population module as it stands: put it into ``naisr_model/data/populations/``, add a line to
``POPULATIONS`` there, and ``naisr populate`` and ``naisr evaluate`` know it. Run as a script it writes some
patients and prepares them for training, in the folder named after it or in a temporary one.

Age lengthens a bone and weight thickens its shaft; every person has a bow of their own, which no covariate
tells.
"""

import csv
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from naisr_model.data.prepare import PrepareOptions, prepare
from naisr_model.data.store import SampleStore
from naisr_model.errors import InputError
from naisr_model.files import replacing
from naisr_model.progress import SILENT, Progress

NAME = "bones"
PATIENTS = 120
AGES_YEARS = (4.0, 16.0)
VISITS_APART_YEARS = 1.5

TOML = """\
name = "bones"

[covariates.age]
unit = "years"

[covariates.weight]
unit = "kg"

[alignment]
method = "none"

[source]
population = "bones"
seed = {seed}
patients = {patients}
"""
"""``source`` tells an evaluation how to make the same people again."""


@dataclass(frozen=True)
class Visit:
    """One person seen once; ``bow_mm`` is what the covariates do not tell."""

    subject: str
    visit: str
    values: Mapping[str, float]
    bow_mm: float


def usual_weight_kg(age: float) -> float:
    """Weight goes with age, as in every population of children."""
    return 8.0 + 3.0 * age


def visits(seed: int, patients: int = PATIENTS) -> list[Visit]:
    """Everybody in order, every third person twice; the same seed gives the same people.

    Raises:
        InputError: when there is nobody.
    """
    if patients < 1:
        raise InputError(f"{patients} patients were asked for; give at least 1")
    return [visit for number in range(patients) for visit in _of_person(number, seed)]


def _of_person(number: int, seed: int) -> list[Visit]:
    rng = np.random.default_rng([seed, number])
    first, build, bow_mm = rng.uniform(*AGES_YEARS), rng.normal(0.0, 0.12), float(rng.normal(0.0, 3.0))
    ages = (first, first + VISITS_APART_YEARS) if number % 3 == 0 else (first,)
    return [
        Visit(f"P{number:03d}", str(place), _values(float(age), build), bow_mm)
        for place, age in enumerate(ages, start=1)
    ]


def _values(age: float, build: float) -> dict[str, float]:
    return {"age": age, "weight": usual_weight_kg(age) * float(np.exp(build))}


def bone(values: Mapping[str, float], bow_mm: float) -> trimesh.Trimesh:
    """A shaft with two heads, closed, in millimetres; the middle is the origin and z runs along it."""
    half_mm = 40.0 + 8.0 * values["age"]
    shaft_mm = 5.0 + 0.08 * values["weight"]
    places = np.linspace(-1, 1, 81)
    heads_mm = 0.8 * shaft_mm * np.exp(-(((np.abs(places) - 0.85) / 0.15) ** 2))
    radii_mm = (shaft_mm + heads_mm) * np.sqrt(np.clip((1 - places**2) / 0.1, 0, 1))
    mesh = trimesh.creation.revolve(np.stack([radii_mm, half_mm * places], axis=1), sections=48)
    mesh.vertices[:, 0] += bow_mm * (1 - (mesh.vertices[:, 2] / half_mm) ** 2)
    return mesh


def visit_shape(visit: Visit) -> tuple[trimesh.Trimesh, dict[str, tuple[float, float, float]]]:
    """The surface of one visit, and no landmarks."""
    return bone(visit.values, visit.bow_mm), {}


def true_shape(values: Mapping[str, float]) -> trimesh.Trimesh:
    """The bone without anybody's own bow."""
    return bone(values, 0.0)


def true_landmarks(values: Mapping[str, float]) -> dict[str, tuple[float, float, float]]:
    """None: all bones lie in one frame."""
    return {}


def growth_path() -> list[tuple[str, str, dict[str, float]]]:
    """Where an atlas is held against the truth: the covariate that moves, a condition, all values."""
    return [("age", "usual", _values(age, 0.0)) for age in (5.0, 8.0, 11.0, 14.0)]


def write_population(out: Path, *, seed: int, patients: int = PATIENTS, progress: Progress = SILENT) -> Path:
    """Write ``data.csv``, ``data.toml`` and ``meshes/*.ply``; returns the path of the table."""
    everybody = visits(seed, patients)
    rows = [["mesh", "subject", "visit", "age", "weight"]]
    for visit, _ in progress.over(everybody):
        mesh = f"meshes/{visit.subject}_{visit.visit}.ply"
        with replacing(out / mesh) as temporary:
            visit_shape(visit)[0].export(temporary, encoding="binary")
        numbers = (f"{visit.values[name]:.6g}" for name in ("age", "weight"))
        rows.append([mesh, visit.subject, visit.visit, *numbers])
    with replacing(out / "data.toml") as temporary:
        temporary.write_text(TOML.format(seed=seed, patients=patients), encoding="utf-8")
    with replacing(out / "data.csv") as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows(rows)
    return out / "data.csv"


if __name__ == "__main__":
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="naisr-"))
    table = write_population(folder / "hospital", seed=0, patients=12)
    print(f"{table} names {len(visits(0, 12))} scans of 12 patients")

    few = PrepareOptions(surface_samples=1000, near_samples=1000, uniform_samples=500, workers=1)
    report = prepare(table, folder / "store", options=few)
    store = SampleStore.open(folder / "store")
    print(f"{len(report.accepted)} shapes prepared, {len(report.rejected)} rejected")
    held_out = {store.population.subjects[row] for row in np.flatnonzero(store.population.held_out)}
    print(f"held out, with all their visits: {', '.join(sorted(held_out))}")
    for covariate in store.population.covariates:
        print(f"{covariate.name}: {' to '.join(map(covariate.format, covariate.range))}")
    for _, _, values in growth_path():
        print(f"true volume at {values['age']:g} years: {true_shape(values).volume / 1000:.2f} cm³")
    print(f"everything is in {folder}; next: naisr train {folder / 'store'} --out bones.safetensors")
