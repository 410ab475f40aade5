"""People of all ages from the parametric body model of the ``anny`` package (the extra ``bodies``).

Covariates: ``age`` in years, through the package's own calibration of its age parameter; ``weight``
in percent of the way from the slimmest (0) to the heaviest (100) build that the package makes at the
given age, sex and height, which is its own weight parameter and **not** a mass; ``sex``. Weight is
drawn independently of age, so every combination is plausible. Height, muscle and bodily
proportions vary between people and are not told; the mean height at each age and sex is the
package's, calibrated on growth charts of the World Health Organization.

Everybody stands with arms and legs a little apart; z is up, the face looks along -y, millimetres, and
the origin is the root of the spine in the pelvis, so that no alignment is needed.

The first use builds the package's model, which takes a minute or two and leaves some 750 MB in
its cache folder (``ANNY_CACHE_DIR``, by default ``~/.cache/anny``). Nothing is downloaded.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import igl
import numpy as np
import trimesh
from numpy.typing import NDArray

from naisr_model.covariates import Covariate, Population
from naisr_model.data.populations import require_size
from naisr_model.data.tables import write_table
from naisr_model.errors import InputError
from naisr_model.files import replacing
from naisr_model.progress import SILENT, Progress

__all__ = [
    "COVARIATES_TOML",
    "Variation",
    "Visit",
    "growth_path",
    "true_landmarks",
    "true_shape",
    "visit_shape",
    "visits",
    "write_population",
]

COVARIATES_TOML = """\
[alignment]
method = "none"

[covariates.age]
unit = "years"
kind = "continuous"

[covariates.weight]
unit = "%"
kind = "continuous"

[covariates.sex]
kind = "binary"
levels = ["F", "M"]
"""

COHORT_PEOPLE = 200
MIN_AGE_YEARS, GROWN_YEARS, MAX_AGE_YEARS = 1.0, 18.0, 80.0
MODEL_AGES_YEARS = (0.0, 110.0)
PATH_AGES_YEARS = (2.0, 5.0, 10.0, 16.0, 30.0, 70.0)

_MUSCLE_SD, _PROPORTIONS_SD = 0.15, 0.15
_MOST_SD = 2.0
_MM_PER_M = 1000.0


@dataclass(frozen=True)
class Variation:
    """How one person differs from the usual one of the same covariates, in standard deviations."""

    height: float = 0.0
    muscle: float = 0.0
    proportions: float = 0.0


@dataclass(frozen=True)
class Visit:
    """One person seen once.

    Attributes:
        subject: person's identifier.
        visit: always ``1``.
        values: age in years, weight in percent of the model's range, sex -1 (F) or +1 (M).
        variation: what makes this person differ from others of the same values.
    """

    subject: str
    visit: str
    values: Mapping[str, float]
    variation: Variation


class _Model(NamedTuple):
    """The body model, its calibration, and the part of its mesh that is the skin."""

    body: Any
    calibration: Any
    vertices: NDArray[np.int64]
    faces: NDArray[np.int64]


@cache
def _model() -> _Model:
    try:
        import anny
        import torch
        from anny.shape_distribution import SimpleShapeDistribution
    except ImportError as error:
        raise InputError(
            "the bodies population needs the package anny; install it with: pip install anny"
        ) from error
    # The package's defaults compress the shapes, which takes minutes, and compile code at first use.
    body = anny.Anny(phenotype_blendshapes="original", skinning_method="lbs").to(dtype=torch.float64)
    vertices, faces = _skin(np.asarray(body.faces, dtype=np.int64))
    return _Model(body, SimpleShapeDistribution(body), vertices, faces)


def _skin(faces: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Keep the largest component: the eyeballs and the inside of the mouth are separate surfaces."""
    _, component = igl.facet_components(faces)
    kept = faces[component == np.bincount(component).argmax()]
    vertices, renumbered = np.unique(kept, return_inverse=True)
    return vertices, renumbered.reshape(-1, 3)


def _body(values: Mapping[str, float], variation: Variation) -> trimesh.Trimesh:
    import torch

    if missing := [name for name in ("age", "weight", "sex") if name not in values]:
        raise InputError(f"the bodies population needs a value for '{missing[0]}'; give age, weight and sex")
    model = _model()
    with torch.no_grad():
        output = model.body(phenotype_kwargs=_phenotypes(model.calibration, values, variation))
    vertices = output["rest_vertices"][0].numpy()[model.vertices] - output["rest_bone_heads"][0, 0].numpy()
    return trimesh.Trimesh(_MM_PER_M * vertices, model.faces, process=False)


def _phenotypes(calibration: Any, values: Mapping[str, float], variation: Variation) -> dict[str, Any]:
    """The package's parameters, all from 0 to 1; its gender runs from male to female."""
    import torch

    years = torch.tensor([np.clip(values["age"], *MODEL_AGES_YEARS)], dtype=torch.float64)
    age = calibration.morphological_age_mapping.morphological_to_anny_age(years)
    female = (1 - np.clip(values["sex"], -1, 1)) / 2
    boy = _height(calibration.boys_conditional_height_distribution, age, variation.height)
    girl = _height(calibration.girls_conditional_height_distribution, age, variation.height)
    numbers = {
        "gender": female,
        "weight": values["weight"] / 100,
        "height": female * girl + (1 - female) * boy,
        "muscle": 0.5 + _MUSCLE_SD * variation.muscle,
        "proportions": 0.5 + _PROPORTIONS_SD * variation.proportions,
    }
    bounded = {name: torch.tensor([np.clip(v, 0, 1)], dtype=torch.float64) for name, v in numbers.items()}
    return bounded | {"age": age}


def _height(distribution: Any, age: Any, score: float) -> float:
    """The package's height parameter at ``score`` standard deviations from the mean at this age."""
    a, b = (float(parameter) for parameter in distribution.get_distribution_params(age))
    mean = a / (a + b)
    return mean + score * float(np.sqrt(mean * (1 - mean) / (a + b + 1)))


def true_shape(values: Mapping[str, float]) -> trimesh.Trimesh:
    """The body without individual variation.

    Args:
        values: ``age`` (years, 0 to 110), ``weight`` (percent of the model's range, 0 to 100) and
            ``sex`` (-1 for F to +1 for M, any value between); values outside are clamped.

    Returns:
        A closed surface in millimetres, outward faces; every body has the same faces.

    Raises:
        InputError: when a value is missing or the package ``anny`` is not installed.
    """
    return _body(values, Variation())


def true_landmarks(values: Mapping[str, float]) -> dict[str, tuple[float, float, float]]:
    """None: the bodies share one frame and need no landmarks."""
    return {}


def visit_shape(visit: Visit) -> tuple[trimesh.Trimesh, dict[str, tuple[float, float, float]]]:
    """The surface of one person, millimetres, and no landmarks."""
    return _body(visit.values, visit.variation), {}


def _age_at(quantile: float) -> float:
    """Half of the people are still growing, because that is when bodies change most."""
    return float(np.interp(quantile, [0.0, 0.5, 1.0], [MIN_AGE_YEARS, GROWN_YEARS, MAX_AGE_YEARS]))


def _person(number: int, quantile: float, sex: float, seed: int) -> Visit:
    rng = np.random.default_rng(np.random.SeedSequence([seed, number]))
    values = {"age": _age_at(quantile), "weight": 100 * float(rng.random()), "sex": sex}
    scores = np.clip(rng.standard_normal(3), -_MOST_SD, _MOST_SD)
    return Visit(f"B{number:04d}", "1", values, Variation(*map(float, scores)))


def visits(seed: int, patients: int = COHORT_PEOPLE) -> list[Visit]:
    """Everybody in order, one visit each; shapes are not made yet.

    Half are from 1 to 18 years old, half from 18 to 80; half are female.

    Raises:
        InputError: when there is nobody or the seed is negative.
    """
    require_size(seed, patients)
    rng = np.random.default_rng(np.random.SeedSequence([seed]))
    sexes = np.where(rng.permutation(patients) % 2 == 0, -1.0, 1.0)
    # One person in each slice of the age distribution keeps it even in a small population.
    quantiles = (rng.permutation(patients) + rng.random(patients)) / patients
    return [_person(i + 1, float(quantiles[i]), float(sexes[i]), seed) for i in range(patients)]


def _population(people: list[Visit]) -> Population:
    covariates = (
        Covariate("age", "years", "continuous", 0.0, 1.0, (MIN_AGE_YEARS, MAX_AGE_YEARS)),
        Covariate("weight", "%", "continuous", 0.0, 1.0, (0.0, 100.0)),
        Covariate("sex", "", "binary", 0.0, 1.0, (-1.0, 1.0), ("F", "M")),
    )
    return Population(
        covariates=covariates,
        subjects=tuple(person.subject for person in people),
        visits=tuple(person.visit for person in people),
        values=np.array([[person.values[c.name] for c in covariates] for person in people]),
        held_out=np.zeros(len(people), dtype=bool),
    )


def write_population(
    out: Path,
    *,
    seed: int,
    patients: int = COHORT_PEOPLE,
    progress: Progress = SILENT,
) -> Path:
    """Write the population as a folder of scans with a table.

    Args:
        out: folder for ``data.csv``, ``data.toml`` and ``meshes/*.ply``.
        seed: the same seed gives the same files.
        patients: number of people.
        progress: told the finished share.

    Returns:
        The path of ``data.csv`` (columns mesh, subject, visit, age, weight, sex).

    Raises:
        InputError: for nobody, a negative seed, or without the package ``anny``.
        Cancelled: when nobody waits any more.
    """
    people = visits(seed, patients)
    meshes = [f"meshes/{person.subject}.ply" for person in people]
    for (person, mesh), _ in progress.over(list(zip(people, meshes, strict=True))):
        with replacing(out / mesh) as temporary, temporary.open("wb") as file:
            visit_shape(person)[0].export(file, file_type="ply", encoding="binary")
    source = f'\n[source]\npopulation = "bodies"\nseed = {seed}\npatients = {patients}\n'
    with replacing(out / "data.toml") as temporary:
        temporary.write_text('name = "bodies"\n\n' + COVARIATES_TOML + source, encoding="utf-8")
    write_table(_population(people), out / "data.csv", meshes=meshes)
    return out / "data.csv"


def growth_path() -> list[tuple[str, str, dict[str, float]]]:
    """Places along growing up and growing old where an atlas is compared with the truth.

    Returns:
        The covariate that moves, women or men, and the covariate values: middle weight at each age.
    """
    return [
        ("age", condition, {"age": age, "weight": 50.0, "sex": sex})
        for condition, sex in (("female", -1.0), ("male", 1.0))
        for age in PATH_AGES_YEARS
    ]
