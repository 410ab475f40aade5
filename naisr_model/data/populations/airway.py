"""A synthetic population of paediatric upper airways with known growth, made like the published cohort.

Two nasal passages join at the choanae, then pharynx, larynx and trachea down to the carina. The
covariates are age, weight and sex; the true shape at any of their values is known, which real
patients never tell.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from naisr_model.data.align import Landmarks
from naisr_model.data.populations import require_size
from naisr_model.data.populations.airway_anatomy import Variation, airway_landmarks, airway_mesh
from naisr_model.data.populations.airway_growth import (
    MAX_AGE_MONTHS,
    MIN_AGE_MONTHS,
    Sizes,
    median_weight_kg,
    sizes,
)
from naisr_model.errors import InputError
from naisr_model.files import replacing
from naisr_model.progress import SILENT, Progress

__all__ = [
    "Visit",
    "growth_path",
    "median_weight_kg",
    "true_landmarks",
    "true_shape",
    "visit_shape",
    "visits",
    "write_population",
]


COVARIATES_TOML = """\
[alignment]
method = "landmarks"
origin = "true vocal cords"

[covariates.age]
unit = "months"
kind = "continuous"

[covariates.weight]
unit = "kg"
kind = "continuous"

[covariates.sex]
kind = "binary"
levels = ["F", "M"]
"""

PATH_AGES_MONTHS = (6.0, 24.0, 60.0, 117.0, 170.0, 220.0)

COHORT_PATIENTS = 263
_PATIENTS_BY_VISITS = {1: 229, 2: 12, 3: 6, 4: 8, 5: 3, 6: 2, 7: 1, 9: 1, 11: 1}
_AGE_DECILES_MONTHS = (1, 23, 55, 71, 89, 111, 129, 161, 179, 199, 233)

_LOG_WEIGHT_SD = 0.18
_WEIGHT_PERSISTENCE = 0.8
_MEDIAN_GAP_MONTHS, _LOG_GAP_SD = 10.0, 0.6
_MOST_SD = 2.5
_POSE_DEG_SD, _POSE_MM_SD = 5.0, 20.0
_WRITERS = 2


@dataclass(frozen=True)
class Visit:
    """One patient seen once.

    Attributes:
        subject: patient identifier.
        visit: visit identifier within the patient.
        values: age in months, weight in kg, sex -1 (F) or +1 (M).
        variation: how this airway differs from the usual one at these values.
        pose: scanner pose of the anatomical frame: rotation vector (degrees) and translation (mm).
    """

    subject: str
    visit: str
    values: Mapping[str, float]
    variation: Variation
    pose: tuple[tuple[float, float, float], tuple[float, float, float]]


def _sizes(values: Mapping[str, float]) -> Sizes:
    if missing := [name for name in ("age", "weight", "sex") if name not in values]:
        raise InputError(f"the airway population needs a value for '{missing[0]}'; give age, weight and sex")
    if not values["weight"] > 0:
        raise InputError(f"weight is {values['weight']:g} kg; give a weight above 0")
    return sizes(values["age"], values["weight"], values["sex"])


def true_shape(values: Mapping[str, float]) -> trimesh.Trimesh:
    """The airway without individual variation.

    Args:
        values: ``age`` (months, 0 to 240, clamped outside), ``weight`` (kg) and ``sex`` (-1 for F to
            +1 for M, any value between).

    Returns:
        A closed surface in millimetres in the anatomical frame, outward faces.

    Raises:
        InputError: when a value is missing or the weight is not positive.
    """
    return airway_mesh(_sizes(values), Variation())


def true_landmarks(values: Mapping[str, float]) -> Landmarks:
    """The eleven landmarks of :func:`true_shape`, millimetres; the true vocal cords are the origin."""
    return airway_landmarks(_sizes(values), Variation())


def visit_shape(visit: Visit) -> tuple[trimesh.Trimesh, Landmarks]:
    """The surface and the landmarks of a visit in the anatomical frame, millimetres."""
    scale = _sizes(visit.values)
    return airway_mesh(scale, visit.variation), airway_landmarks(scale, visit.variation)


def _visit_counts(patients: int) -> list[int]:
    """How often each patient is seen, the most frequent visitors last; largest remainders round."""
    exact = {n: share * patients / COHORT_PATIENTS for n, share in _PATIENTS_BY_VISITS.items()}
    counts = {n: int(value) for n, value in exact.items()}
    by_remainder = sorted(exact, key=lambda n: counts[n] - exact[n])
    for n in by_remainder[: patients - sum(counts.values())]:
        counts[n] += 1
    return [n for n, count in counts.items() for _ in range(count)]


def _bounded(rng: np.random.Generator) -> float:
    """A standard normal number, clipped where shapes would become implausible."""
    return float(np.clip(rng.standard_normal(), -_MOST_SD, _MOST_SD))


def _age_at(quantile: float) -> float:
    return float(np.interp(quantile, np.linspace(0.0, 1.0, len(_AGE_DECILES_MONTHS)), _AGE_DECILES_MONTHS))


def _visit_ages(quantile: float, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Increasing ages in months about the quantile of the published age distribution, ``[count]``."""
    gaps = _MEDIAN_GAP_MONTHS * np.exp(_LOG_GAP_SD * np.clip(rng.standard_normal(count - 1), -2.0, 2.0))
    since_first = np.concatenate([[0.0], np.cumsum(gaps)])
    longest = MAX_AGE_MONTHS - MIN_AGE_MONTHS
    since_first *= min(1.0, longest / max(since_first[-1], 1.0))
    first = _age_at(quantile) - since_first[-1] / 2
    return np.clip(first, MIN_AGE_MONTHS, MAX_AGE_MONTHS - since_first[-1]) + since_first


def _weight_kg(age: float, sex: float, habit: float, rng: np.random.Generator) -> float:
    """A weight whose mean given age and sex is the growth path; ``habit`` stays with the patient."""
    score = _WEIGHT_PERSISTENCE * habit + np.sqrt(1 - _WEIGHT_PERSISTENCE**2) * _bounded(rng)
    return float(median_weight_kg(age, sex) * np.exp(_LOG_WEIGHT_SD * score - _LOG_WEIGHT_SD**2 / 2))


def _patient_variation(rng: np.random.Generator) -> Variation:
    return Variation(
        log_calibre=0.05 * _bounded(rng),
        log_length=0.03 * _bounded(rng),
        log_pharynx=0.06 * _bounded(rng),
        neck_forward_deg=3.0 * _bounded(rng),
        neck_sideways_deg=2.0 * _bounded(rng),
        nose_deg=3.0 * _bounded(rng),
    )


def _visit_variation(patient: Variation, rng: np.random.Generator) -> Variation:
    """The patient's own airway on one day: head position and muscle tone come on top."""
    return Variation(
        log_calibre=patient.log_calibre + 0.03 * _bounded(rng),
        log_length=patient.log_length,
        log_pharynx=patient.log_pharynx + 0.04 * _bounded(rng),
        neck_forward_deg=patient.neck_forward_deg + 4.0 * _bounded(rng),
        neck_sideways_deg=patient.neck_sideways_deg + 1.0 * _bounded(rng),
        nose_deg=patient.nose_deg,
    )


def _pose(rng: np.random.Generator) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    (rx, ry, rz), (tx, ty, tz) = _POSE_DEG_SD * rng.standard_normal(3), _POSE_MM_SD * rng.standard_normal(3)
    return (float(rx), float(ry), float(rz)), (float(tx), float(ty), float(tz))


def _patient_visits(number: int, sex: float, count: int, quantile: float, seed: int) -> list[Visit]:
    rng = np.random.default_rng(np.random.SeedSequence([seed, number]))
    habit, variation = _bounded(rng), _patient_variation(rng)
    result = []
    for index, age in enumerate(_visit_ages(quantile, count, rng), start=1):
        own = np.random.default_rng(np.random.SeedSequence([seed, number, index]))
        values = {"age": float(age), "weight": _weight_kg(float(age), sex, habit, own), "sex": sex}
        result.append(
            Visit(f"P{number:04d}", str(index), values, _visit_variation(variation, own), _pose(own))
        )
    return result


def visits(seed: int, patients: int = COHORT_PATIENTS) -> list[Visit]:
    """Everybody who was seen, in order of patient and visit; shapes are not made yet.

    With 263 patients the numbers of visits are those of the published cohort (357 visits); ages
    follow its deciles, and half of the patients are girls.

    Raises:
        InputError: when there are no patients or the seed is negative.
    """
    require_size(seed, patients)
    rng = np.random.default_rng(np.random.SeedSequence([seed]))
    counts = rng.permutation(_visit_counts(patients))
    sexes = np.where(rng.permutation(patients) % 2 == 0, -1.0, 1.0)
    # One patient in each slice of the age distribution keeps the deciles even in a small population.
    quantiles = (rng.permutation(patients) + rng.random(patients)) / patients
    people = zip(range(1, patients + 1), sexes, counts, quantiles, strict=True)
    return [
        visit
        for number, sex, count, quantile in people
        for visit in _patient_visits(number, float(sex), int(count), float(quantile), seed)
    ]


def _in_scanner(visit: Visit) -> tuple[trimesh.Trimesh, Landmarks]:
    mesh, landmarks = visit_shape(visit)
    rotation = Rotation.from_rotvec(np.radians(visit.pose[0]))
    moved = rotation.apply(list(landmarks.values())) + visit.pose[1]
    mesh.vertices = rotation.apply(mesh.vertices) + visit.pose[1]
    return mesh, {
        name: (float(x), float(y), float(z)) for name, (x, y, z) in zip(landmarks, moved, strict=True)
    }


def _write(path: Path, content: bytes) -> None:
    with replacing(path) as temporary:
        temporary.write_bytes(content)


def _csv(rows: list[list[str]]) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue().encode()


def _write_visit(out: Path, visit: Visit) -> None:
    mesh, landmarks = _in_scanner(visit)
    with replacing(out / _mesh_name(visit)) as temporary, temporary.open("wb") as file:
        mesh.export(file, file_type="ply", encoding="binary")
    points = [[name, *(f"{value:.6f}" for value in point)] for name, point in landmarks.items()]
    _write(out / _landmarks_name(visit), _csv([["name", "x", "y", "z"], *points]))


def _mesh_name(visit: Visit) -> str:
    return f"meshes/{visit.subject}_{visit.visit}.ply"


def _landmarks_name(visit: Visit) -> str:
    return f"landmarks/{visit.subject}_{visit.visit}.csv"


def _row(visit: Visit) -> list[str]:
    age, weight = f"{visit.values['age']:.6g}", f"{visit.values['weight']:.6g}"
    sex = "F" if visit.values["sex"] < 0 else "M"
    return [_mesh_name(visit), _landmarks_name(visit), visit.subject, visit.visit, age, weight, sex]


def _wait_for(jobs: list[Future[None]], progress: Progress) -> None:
    for done, job in enumerate(as_completed(jobs), start=1):
        job.result()
        progress.tell(done / len(jobs))
        progress.check()


def write_population(
    out: Path,
    *,
    seed: int,
    patients: int = COHORT_PATIENTS,
    progress: Progress = SILENT,
) -> Path:
    """Write the population as a hospital would hand it over: every scan in its own pose.

    Args:
        out: folder for ``data.csv``, ``data.toml``, ``meshes/*.ply`` and ``landmarks/*.csv``.
        seed: the same seed gives the same files.
        patients: 263 is the size of the published cohort.
        progress: told the finished share.

    Returns:
        The path of ``data.csv`` (columns mesh, landmarks, subject, visit, age, weight, sex).

    Raises:
        InputError: for fewer than one patient or a negative seed.
        Cancelled: when nobody waits any more.
    """
    everybody = visits(seed, patients)
    pool = ThreadPoolExecutor(_WRITERS)
    try:
        jobs = [pool.submit(_write_visit, out, visit) for visit in everybody]
        _wait_for(jobs, progress)
    finally:
        pool.shutdown(cancel_futures=True)
    source = f'\n[source]\npopulation = "airway"\nseed = {seed}\npatients = {patients}\n'
    _write(out / "data.toml", ('name = "airway"\n\n' + COVARIATES_TOML + source).encode())
    header = ["mesh", "landmarks", "subject", "visit", "age", "weight", "sex"]
    _write(out / "data.csv", _csv([header, *map(_row, everybody)]))
    return out / "data.csv"


def growth_path() -> list[tuple[str, str, dict[str, float]]]:
    """Places along the population growth path where an atlas is compared with the truth.

    Returns:
        The covariate that moves, girls or boys, and the covariate values: usual weight at each age.
    """
    return [
        ("age", condition, {"age": age, "weight": median_weight_kg(age, sex), "sex": sex})
        for condition, sex in (("girls", -1.0), ("boys", 1.0))
        for age in PATH_AGES_MONTHS
    ]
