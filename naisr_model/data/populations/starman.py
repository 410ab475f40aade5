"""Starman: a synthetic population in the plane, little men who lift their arms and split their legs.

The paper's section "Starman Dataset" (after Bône et al. 2020), with what it leaves open chosen here. With X
the template and c_0, c_1 its hands, c_2, c_3 its feet,

    X_r = X + d_r(X),   c_ir = c_i + d_r(c_i)                    one deformation for each subject
    d_i(p) = alpha exp(-|p - c_ir|^2 / (2 sigma^2)) m_0          arms, i = 0, 1
    d_i(p) = beta exp(-|p - c_ir|^2 / (2 sigma^2)) (+-m_1)       legs, i = 2, 3, opposite signs
    Y = X_r + sum_i d_i(X_r)                                     one shape for each pose

with sigma = 0.5 and alpha, beta ~ U[-1, 1]. Chosen: the template is a periodic cubic spline through
:data:`TEMPLATE`, sampled evenly; m_0 = (0, 0.4) lifts both arms; m_1 = (0.25, 0) splits the legs; d_r is a
sum of Gaussian kernels exp(-r^2) on a grid of spacing 1 with momenta of a standard deviation of 0.1 for each
coordinate, none beyond 2.5 of them. Lengths have no unit.

Vertex k of a shape is vertex k of the template in every file, so the true correspondence is known.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from naisr_model.data.align import Landmarks
from naisr_model.data.populations import require_size
from naisr_model.errors import InputError
from naisr_model.files import replacing
from naisr_model.progress import SILENT, Progress
from naisr_model.shapes.curve import Curve, closed
from naisr_model.shapes.written import csv_bytes

__all__ = [
    "Visit",
    "growth_path",
    "true_landmarks",
    "true_shape",
    "visit_shape",
    "visits",
    "write_population",
]

Points = NDArray[np.float64]

_RIGHT_HALF = np.array(
    [
        [0.22, 0.42],  # neck
        [0.55, 0.34],
        [0.95, 0.36],  # hand, above
        [1.05, 0.26],
        [0.95, 0.16],  # hand, below
        [0.55, 0.10],
        [0.30, 0.00],  # armpit
        [0.28, -0.30],
        [0.42, -0.65],
        [0.56, -0.98],  # foot, outside
        [0.47, -1.08],
        [0.33, -1.02],  # foot, inside
        [0.18, -0.70],
    ]
)
_CROTCH, _HEAD = (
    np.array([[0.0, -0.42]]),
    np.array([[0.24, 0.60], [0.22, 0.84], [0.0, 0.98], [-0.22, 0.84], [-0.24, 0.60]]),
)
_MIRROR = np.array([-1.0, 1.0])
TEMPLATE = np.concatenate([_CROTCH, _RIGHT_HALF[::-1], _HEAD, _MIRROR * _RIGHT_HALF])
"""What the template's spline goes through, left round from the crotch."""

VERTICES = 400
"""Of a shape."""

CONTROLS = np.array([[0.85, 0.26], [-0.85, 0.26], [0.42, -0.90], [-0.42, -0.90]])
"""c_0 ... c_3: hands and feet."""

MOVES = np.array([[0.0, 0.4], [0.0, 0.4], [0.25, 0.0], [-0.25, 0.0]])
"""m_0 of both arms, m_1 of both legs."""

SIGMA = 0.5

GRID = np.stack(np.meshgrid([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]), axis=-1).reshape(-1, 2)
"""Where the momenta of d_r sit."""

MOMENTUM_SD, MOST_SD = 0.1, 2.5

SUBJECTS = 2000
"""Half of them to train on, half to test with."""

MOST_POSES = 10

SHAPES_A_SUBJECT = (5041 + 4966) / SUBJECTS
"""As published; 1 to 10 poses, all alike, make 5.5 on average, so some poses are left out by chance."""

COVARIATES_TOML = """\
unit = "units"

[alignment]
method = "none"

[covariates.arms]
kind = "continuous"

[covariates.legs]
kind = "continuous"
"""

PATH = (-0.9, -0.6, -0.3, 0.0, 0.3, 0.6, 0.9)


@dataclass(frozen=True, eq=False)
class Visit:
    """One subject in one pose.

    Attributes:
        subject: whose shape it is.
        visit: number of the pose.
        values: arms (alpha) and legs (beta), -1 to 1.
        momenta: of the subject's own deformation d_r at :data:`GRID`, ``[9, 2]``.
    """

    subject: str
    visit: str
    values: Mapping[str, float]
    momenta: Points


@cache
def _template() -> Points:
    """Points of the template spread evenly by length, left round, ``[VERTICES, 2]``."""
    knots = np.concatenate([TEMPLATE, TEMPLATE[:1]])
    chords = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(knots, axis=0), axis=1))])
    fine = CubicSpline(chords, knots, bc_type="periodic")(np.linspace(0, chords[-1], 100 * VERTICES + 1))
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(fine, axis=0), axis=1))])
    even = np.linspace(0, along[-1], VERTICES, endpoint=False)
    return np.stack([np.interp(even, along, fine[:, axis]) for axis in (0, 1)], axis=1)


def _kernels(points: Points, centres: Points, variance: float) -> Points:
    """exp(-r^2 / (2 variance)) of each of ``points [n, 2]`` about each of ``centres [k, 2]``, ``[n, k]``."""
    squared = ((points[:, None] - centres) ** 2).sum(axis=2)
    return np.exp(-squared / (2 * variance))


def _shape(values: Mapping[str, float], momenta: Points) -> Curve:
    if missing := [name for name in ("arms", "legs") if name not in values]:
        raise InputError(f"the starman population needs a value for '{missing[0]}'; give arms and legs")
    own, controls = (points + _kernels(points, GRID, 0.5) @ momenta for points in (_template(), CONTROLS))
    strengths = np.array([values["arms"], values["arms"], values["legs"], values["legs"]])
    return closed([own + _kernels(own, controls, SIGMA**2) @ (strengths[:, None] * MOVES)])


def true_shape(values: Mapping[str, float]) -> Curve:
    """The starman without individual variation.

    Args:
        values: ``arms`` and ``legs``, -1 to 1; one of them alone, the other 0, is a true effect.

    Returns:
        A closed curve; vertex k is vertex k of every other shape.

    Raises:
        InputError: when a value is missing.
    """
    return _shape(values, np.zeros_like(GRID))


def true_landmarks(values: Mapping[str, float]) -> Landmarks:
    """None: the shapes share one frame and need no landmarks."""
    return {}


def visit_shape(visit: Visit) -> tuple[Curve, Landmarks]:
    """The curve of one pose, and no landmarks."""
    return _shape(visit.values, visit.momenta), {}


def _pose_counts(subjects: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """1 to 10 poses each, some left out by chance until there are as many as published, ``[subjects]``."""
    counts = rng.integers(1, MOST_POSES + 1, subjects)
    wanted = max(subjects, round(SHAPES_A_SUBJECT * subjects))
    while counts.sum() > wanted:
        counts[rng.choice(np.flatnonzero(counts > 1))] -= 1
    return counts


def _poses(number: int, count: int, seed: int) -> list[Visit]:
    rng = np.random.default_rng(np.random.SeedSequence([seed, number]))
    momenta = MOMENTUM_SD * np.clip(rng.standard_normal(GRID.shape), -MOST_SD, MOST_SD)
    found = []
    for pose in range(1, count + 1):
        arms, legs = rng.uniform(-1, 1, 2).tolist()
        found.append(Visit(f"S{number:04d}", str(pose), {"arms": arms, "legs": legs}, momenta))
    return found


def visits(seed: int, patients: int = SUBJECTS) -> list[Visit]:
    """Everybody in every pose, in order; shapes are not made yet.

    Of 2000 subjects there are the 10,007 shapes of the paper.

    Raises:
        InputError: when there is nobody or the seed is none.
    """
    require_size(seed, patients)
    counts = _pose_counts(patients, np.random.default_rng(np.random.SeedSequence([seed])))
    people = enumerate(counts.tolist(), start=1)
    return [visit for number, count in people for visit in _poses(number, count, seed)]


def write_population(
    out: Path,
    *,
    seed: int,
    patients: int = SUBJECTS,
    progress: Progress = SILENT,
) -> Path:
    """Write the population as a folder of curves with a table.

    Args:
        out: folder for ``data.csv``, ``data.toml`` and ``curves/*.csv``.
        seed: the same seed gives the same files.
        patients: number of subjects; of 2000 half are the paper's training set, half its test set, when the
            store is prepared with ``--held-out 0.5``.
        progress: told the finished share.

    Returns:
        The path of ``data.csv`` (columns mesh, subject, visit, arms, legs).

    Raises:
        InputError: for nobody or a negative seed.
        Cancelled: when nobody waits any more.
    """
    everybody = visits(seed, patients)
    for visit, _ in progress.over(everybody):
        _write(out / _file_of(visit), csv_bytes(visit_shape(visit)[0]))
    text = io.StringIO()
    rows = [[_file_of(visit), visit.subject, visit.visit, *map(repr, _values(visit))] for visit in everybody]
    csv.writer(text, lineterminator="\n").writerows([["mesh", "subject", "visit", "arms", "legs"], *rows])
    source = f'\n[source]\npopulation = "starman"\nseed = {seed}\npatients = {patients}\n'
    _write(out / "data.toml", ('name = "starman"\n' + COVARIATES_TOML + source).encode())
    _write(out / "data.csv", text.getvalue().encode())
    return out / "data.csv"


def _values(visit: Visit) -> list[float]:
    return [visit.values["arms"], visit.values["legs"]]


def _file_of(visit: Visit) -> str:
    return f"curves/{visit.subject}_{visit.visit}.csv"


def _write(path: Path, content: bytes) -> None:
    with replacing(path) as temporary:
        temporary.write_bytes(content)


def growth_path() -> list[tuple[str, str, dict[str, float]]]:
    """Places along lifting the arms and splitting the legs where an atlas is compared with the truth.

    Returns:
        The covariate that moves, what the other is, and both values.
    """
    arms = [
        ("arms", f"legs {legs:g}", {"arms": value, "legs": legs}) for legs in (0.0, 0.9) for value in PATH
    ]
    return [*arms, *(("legs", "arms 0", {"arms": 0.0, "legs": value}) for value in PATH)]
