"""The shapes that a training never saw, and where they come from: a store, or a population's own seed.

Atlas, store and population are opened once a process, however many cases ask for them.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from naisr_model.atlas import Atlas
from naisr_model.covariates import Population
from naisr_model.data import populations
from naisr_model.data.align import Landmarks, rigid_transform
from naisr_model.data.populations import PopulationModule, PopulationVisit
from naisr_model.data.store import INDEX, SampleStore
from naisr_model.errors import InputError
from naisr_model.measures.norms import Norms, norms_of
from naisr_model.shapes.kinds import Shape


@dataclass(frozen=True, eq=False)
class HeldOut:
    """One shape that the training never saw, in the atlas frame.

    Attributes:
        values: covariates in real units.
        mesh_mm: the surface.
        subject: whose it is.
        visit: which of the subject's.
    """

    values: dict[str, float]
    mesh_mm: Shape
    subject: str = ""
    visit: str = ""


def opened(path: Path) -> Atlas:
    """The atlas in a file.

    Raises:
        InputError: when it cannot be read.
    """
    return _opened(path, _changed(path))


def _changed(path: Path) -> tuple[int, ...]:
    """What tells a file from another one at its place; clocks are coarse, so its own number as well."""
    if not path.exists():
        return ()
    status = path.stat()
    return status.st_mtime_ns, status.st_size, status.st_ino


@lru_cache(maxsize=2)
def _opened(path: Path, _changed: tuple[int, ...]) -> Atlas:
    return Atlas.load(path)


def opened_store(path: Path) -> SampleStore:
    """The store in a folder.

    Raises:
        InputError: when it cannot be read.
    """
    return _opened_store(path, _changed(path / INDEX))


@lru_cache(maxsize=2)
def _opened_store(path: Path, _changed: tuple[int, ...]) -> SampleStore:
    return SampleStore.open(path)


@lru_cache(maxsize=1)
def known_norms(atlas: Atlas) -> Norms:
    """What is usual among the people of an atlas.

    Raises:
        InputError: when they are too few or all alike, where the model deforms no template, where it folds,
            or where it is one of curves.
    """
    return norms_of(atlas)


def held_out_rows(atlas: Atlas, limit: int = 0, subjects: Collection[str] | None = None) -> list[int]:
    """The first rows of a population that were held out.

    Args:
        atlas: whose population.
        limit: at most so many; 0 takes all.
        subjects: whose rows count; None for all.
    """
    people = atlas.population
    rows = [int(row) for row in np.flatnonzero(people.held_out)]
    return [row for row in rows if subjects is None or people.subjects[row] in subjects][: limit or None]


def require_shapes(atlas: Atlas, store: Path | None, limit: int = 0) -> None:
    """Make sure that there are held-out shapes and that :func:`held_out` finds them.

    Raises:
        InputError: when nothing was held out, ``limit`` is below 0, or the atlas was made from somebody's own
            data and no store, or another, is given.
    """
    if limit < 0:
        raise InputError(f"--limit is {limit}; give 0 or more")
    if not atlas.population.held_out.any():
        raise InputError("no shape was held out, so nothing can be evaluated; prepare with --held-out 0.2")
    if store is not None:
        _require_same_data(atlas, opened_store(store))
    elif synthetic(atlas) is None:
        raise InputError(
            "this atlas was made from data of your own; give the store it was trained on with --store"
        )
    elif strangers := [one for one in _held_out_visits(atlas.population) if one not in source_visits(atlas)]:
        subject, visit = strangers[0]
        raise InputError(
            f"subject '{subject}', visit '{visit}' is not in the population that the atlas names; "
            "give the store it was trained on with --store"
        )


def held_out(atlas: Atlas, store: Path | None, row: int) -> HeldOut:
    """The shape of one row of a population, which :func:`require_shapes` has been asked about.

    Args:
        atlas: what was trained.
        store: what it was trained on; None where the population can be made again.
        row: of the atlas's population.
    """
    people = atlas.population
    subject, visit = people.subjects[row], people.visits[row]
    if store is not None:
        samples = opened_store(store)
        rows = zip(samples.population.subjects, samples.population.visits, strict=True)
        return HeldOut(people.row(row), samples.mesh(list(rows).index((subject, visit))), subject, visit)
    module = known_population(atlas)
    seen = source_visits(atlas)[subject, visit]
    values = {name: seen.values[name] for name in people.names}
    return HeldOut(values, aligned(atlas, *module.visit_shape(seen)), subject, visit)


def _require_same_data(atlas: Atlas, store: SampleStore) -> None:
    known, given = atlas.checkpoint.population, store.population
    same = {
        "covariates": known.covariates == given.covariates,
        "frame": atlas.frame == store.frame,
        "alignment": atlas.checkpoint.alignment == store.alignment,
        "held-out shapes": _held_out_visits(known) == _held_out_visits(given),
    }
    if other := [name for name, equal in same.items() if not equal]:
        raise InputError(
            f"{store.path} is not the store that this atlas was trained on: other {', '.join(other)}"
        )


def _held_out_visits(population: Population) -> list[tuple[str, str]]:
    rows = np.flatnonzero(population.held_out)
    return [(population.subjects[row], population.visits[row]) for row in rows]


def synthetic(atlas: Atlas) -> PopulationModule | None:
    """The population that an atlas records as its source and that can be made again."""
    source = atlas.checkpoint.source
    name, seed, patients = (source.get(key) for key in ("population", "seed", "patients"))
    if name not in populations.POPULATIONS or not isinstance(seed, int) or not isinstance(patients, int):
        return None
    is_possible = seed >= 0 and 1 <= patients <= populations.MOST_PATIENTS
    return populations.population(str(name)) if is_possible else None


def known_population(atlas: Atlas) -> PopulationModule:
    """The same, where there has to be one.

    Raises:
        InputError: when the atlas is of real data.
    """
    module = synthetic(atlas)
    if module is None:
        raise InputError("only atlases of synthetic populations can be asked this; real truth is not known")
    return module


def source_visits(atlas: Atlas) -> dict[tuple[str, str], PopulationVisit]:
    """Everybody in the synthetic population that an atlas records as its source, by subject and visit."""
    source = atlas.checkpoint.source
    return visits_of(str(source["population"]), int(source["seed"]), int(source["patients"]))


@lru_cache(maxsize=2)
def visits_of(population: str, seed: int, patients: int) -> dict[tuple[str, str], PopulationVisit]:
    """Everybody in a synthetic population, in its order, by subject and visit."""
    visits = populations.population(population).visits(seed, patients)
    return {(visit.subject, visit.visit): visit for visit in visits}


def aligned(atlas: Atlas, mesh: Shape, landmarks: Landmarks) -> Shape:
    """A scan in millimetres and its landmarks, moved to the atlas frame as the training scans were."""
    moved = mesh.copy()
    moved.apply_transform(rigid_transform(atlas.checkpoint.alignment, mesh, landmarks))
    return moved
