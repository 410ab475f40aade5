"""Do the 95 % intervals of a fit hold the truth as often as they say? Asked of patients made for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from naisr_model.atlas import Atlas
from naisr_model.covariates import require_known
from naisr_model.data.populations import MOST_PATIENTS, PopulationVisit
from naisr_model.errors import InputError
from naisr_model.evaluation.held_out import aligned, known_population, opened, visits_of
from naisr_model.progress import SILENT, Progress
from naisr_model.work.journal import Record

OTHER_SEED = 1000
"""Added to the seed of the atlas's population, so that nobody in it is met again."""

AGREED = (0.90, 0.99)
"""Shares of intervals holding the truth that count as calibrated; of the two levels of a binary covariate
an interval can only hold one or both, so there the upper end does not count."""


@dataclass(frozen=True)
class NewPatient:
    """Somebody whom the atlas's population does not know, by the names in the new one."""

    subject: str
    visit: str

    @property
    def key(self) -> str:
        """Both names."""
        return f"{self.subject} {self.visit}"


def new_patients(path: Path, count: int) -> list[NewPatient]:
    """The first visits of people whom an atlas does not know, with covariates inside the observed ranges.

    Raises:
        InputError: when the atlas is not of a synthetic population, or nobody or too many are asked for.
    """
    if not 1 <= count <= MOST_PATIENTS // 2:
        raise InputError(f"--patients is {count}; give 1 or more, up to {MOST_PATIENTS // 2}")
    atlas = opened(path)
    known_population(atlas)
    inside = [one for one in _everybody(atlas, count).values() if atlas.population.contains(one.values)]
    first = {visit.subject: visit for visit in reversed(inside)}
    chosen = list(dict.fromkeys(visit.subject for visit in inside))[:count]
    return [NewPatient(subject, first[subject].visit) for subject in chosen]


def visit_of(atlas: Atlas, case: NewPatient, count: int) -> PopulationVisit:
    """One of them, of as many as were asked for."""
    return _everybody(atlas, count)[case.subject, case.visit]


def _everybody(atlas: Atlas, count: int) -> dict[tuple[str, str], PopulationVisit]:
    """Twice as many patients as are asked for: not all are inside the observed ranges."""
    source = atlas.checkpoint.source
    return visits_of(str(source["population"]), int(source["seed"]) + OTHER_SEED, 2 * count)


@dataclass(frozen=True)
class Calibration:
    """Count how often the 95 % intervals of a fit hold the truth, over new synthetic patients.

    Attributes:
        atlas: the .safetensors file, of a synthetic population.
        patients: how many are made and fitted.
        known: covariates that the fits are told, as age,sex; the others are inferred.
    """

    atlas: Path
    _: KW_ONLY
    patients: int = 200
    known: str = ""

    def cases(self) -> list[NewPatient]:
        """The first visits of patients of another seed whose covariates are inside the observed ranges.

        Raises:
            InputError: as :func:`new_patients`, and when ``known`` has an unknown name.
        """
        chosen = new_patients(self.atlas, self.patients)
        require_known(self._told(), opened(self.atlas).covariates)
        return chosen

    def measure(self, case: NewPatient, progress: Progress = SILENT) -> Record:
        """Truth, estimate and both ends of the interval of each inferred covariate and of the volume.

        Raises:
            Cancelled: when nobody waits any more.
        """
        atlas = opened(self.atlas)
        visit = visit_of(atlas, case, self.patients)
        mesh_mm = aligned(atlas, *known_population(atlas).visit_shape(visit))
        known = {name: visit.values[name] for name in self._told()}
        fit = atlas.fit(mesh_mm, known, progress=progress)
        found = {
            name: [visit.values[name], fit.covariates[name], *ends] for name, ends in fit.intervals.items()
        }
        extent = atlas.extent
        return found | {extent.title: [extent.of(mesh_mm), fit.extent, *fit.extent_interval]}

    def summarise(self, records: Sequence[Record]) -> Record:
        """The report.

        Returns:
            ``n``, ``known``, and in ``rows`` for each inferred covariate and the volume the ``coverage``,
            the median ``width`` of the interval, the root mean square ``error`` and the ``unit``; of a
            binary covariate the share of ``undecided`` and of ``wrong`` levels instead of the latter.
        """
        atlas = opened(self.atlas)
        kinds = {covariate.name: (covariate.unit, covariate.kind) for covariate in atlas.covariates}
        kinds[atlas.extent.title] = (atlas.extent.unit, "continuous")
        rows = {name: _summary([record[name] for record in records], *kinds[name]) for name in records[0]}
        return {"n": len(records), "known": self._told(), "rows": rows}

    def markdown(self, report: Mapping[str, Any]) -> str:
        """The report as a table."""
        given = f"{', '.join(report['known'])} known" if report["known"] else "nothing known"
        lines = [
            f"**{report['n']} new patients, {given}**",
            "",
            "|  | truth inside the 95 % interval | median width | root mean square error | calibrated |",
            "| --- | ---: | ---: | ---: | --- |",
        ]
        lines += [_markdown_row(name, row) for name, row in report["rows"].items()]
        return "\n".join(lines)

    def _told(self) -> list[str]:
        return [name.strip() for name in self.known.split(",") if name.strip()]


def _summary(rows: list[list[float]], unit: str, kind: str) -> dict[str, Any]:
    truth, estimate, low, high = np.array(rows).T
    rounding = 1e-9 * (1 + np.abs(truth))
    coverage = float(((low - rounding <= truth) & (truth <= high + rounding)).mean())
    if kind == "binary":
        wrong = float((np.sign(estimate) != np.sign(truth)).mean())
        return {"coverage": coverage, "undecided": float((high > low).mean()), "wrong": wrong}
    return {
        "coverage": coverage,
        "width": float(np.median(high - low)),
        "error": float(np.sqrt(np.mean((estimate - truth) ** 2))),
        "unit": unit,
    }


def _markdown_row(name: str, row: Mapping[str, Any]) -> str:
    low, high = AGREED
    if "wrong" in row:
        cells = [f"{100 * row['undecided']:.0f} % undecided", f"{100 * row['wrong']:.0f} % wrong"]
        agreed = low <= row["coverage"]
    else:
        cells = [f"{row['width']:.3g} {row['unit']}", f"{row['error']:.3g} {row['unit']}"]
        agreed = low <= row["coverage"] <= high
    return f"| {name} | {100 * row['coverage']:.1f} % | {' | '.join(cells)} | {'yes' if agreed else 'no'} |"
