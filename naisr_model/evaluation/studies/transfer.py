"""Does a fit tell how a person looks at other covariates? The paper's shape transfer, held against the truth.

Two questions are asked. *Other visits*: the first visit of a held-out subject is fitted and each later one
predicted at its covariates, as in the paper; what changes from day to day, such as the position of the head,
is in the truth and cannot be predicted. *Same person, other covariates*: of a synthetic population the
generator knows what the fitted person looks like, on the same day, with somebody else's age and weight, also
where everybody was seen once; there what a fit leaves out as not lasting counts against it.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from naisr_model.atlas import Atlas, Fit, Individual
from naisr_model.covariates import Population
from naisr_model.data.populations import PopulationModule
from naisr_model.data.store import SampleStore
from naisr_model.errors import Cancelled, InputError
from naisr_model.evaluation.metrics import Distances, compare
from naisr_model.evaluation.reports import (
    COLUMNS,
    Published,
    definitions,
    distance_cells,
    markdown_table,
    meaning,
    published_cells,
    summary,
)
from naisr_model.evaluation.studies.reconstruction import (
    HeldOut,
    aligned,
    held_out_shapes,
    is_inside,
    source_visits,
    synthetic,
)

Progress = Callable[[float], None]
StopCheck = Callable[[], bool]

WAYS = {
    "given": "fitted, covariates given",
    "inferred": "fitted, covariates inferred",
    "kept": "fitted, covariates given, the whole code kept as in the paper",
    "average": "no fit: the population's average at the same covariates",
}
QUESTIONS = {"visits": "Other visits", "counterfactuals": "Same person, other covariates"}

PUBLISHED_NOTE = "NAISR (ICLR 2024), Table 3, other visits of real patients, so other shapes than these"


@dataclass(frozen=True, eq=False)
class Prediction:
    """One way to predict a shape, measured.

    Attributes:
        distances: from the truth; None where nothing was predicted.
        volume_cm3: predicted.
        interval_cm3: of the volume, 95 %; None where there is none.
    """

    distances: Distances | None
    volume_cm3: float
    interval_cm3: tuple[float, float] | None


@dataclass(frozen=True, eq=False)
class Case:
    """A person seen once, and predicted elsewhere in every way of :data:`WAYS`."""

    seen: HeldOut
    truth: HeldOut
    ways: Mapping[str, Prediction]


def transfer(
    atlas: Atlas,
    store: SampleStore | None = None,
    limit: int | None = None,
    *,
    progress: Progress | None = None,
    should_stop: StopCheck | None = None,
) -> dict[str, Any]:
    """Fit each held-out subject's first visit and predict the others, and the same person elsewhere.

    A fit is shown at the other covariates themselves, whether its own were given or inferred, with what is
    expected to last of its code; beside it stands the paper's transfer, which keeps the whole code. (To
    inferred covariates the paper adds the change of the true ones; where a shape hardly tells the age, as a
    grown-up's does, this carries the error of the age along.) In the second question the covariates
    are those of the next held-out subject with the same binary ones, so that they are plausible together;
    the truth is what the synthetic population makes of the fitted visit's own variation at them. Subjects
    whose first visit is outside the observed ranges are left out.

    Args:
        atlas: what was trained.
        store: where its held-out shapes are; None where the population can be made again.
        limit: at most so many subjects, those with most visits first.
        progress: told the finished share.
        should_stop: polled between steps.

    Returns:
        For each of :data:`QUESTIONS` that can be asked a record with a :func:`~.tables.summary` and the
        share ``held`` of volumes inside their interval and its median ``width_cm3`` for each of
        :data:`WAYS`, and ``cases`` with the volumes in cm3; and what the columns mean.

    Raises:
        InputError: when there is nobody to predict.
        Cancelled: when ``should_stop()`` turned true.
    """
    subjects = _subjects(atlas.population)[:limit]
    shapes = held_out_shapes(atlas, store, subjects=subjects)
    cases: dict[str, list[Case]] = {question: [] for question in QUESTIONS}
    for done, subject in enumerate(subjects, start=1):
        visits = [shape for shape in shapes if shape.subject == subject]
        truths = {"visits": visits[1:], "counterfactuals": _counterfactuals(atlas, visits[0])}
        if any(truths.values()):
            fits = [
                atlas.fit(visits[0].mesh_mm, known, should_stop=should_stop)
                for known in (visits[0].values, {})
            ]
        for question, targets in truths.items():
            cases[question] += [_case(atlas, visits[0], target, fits, should_stop) for target in targets]
        if progress is not None:
            progress(done / len(subjects))
    asked = {question: found for question, found in cases.items() if found}
    if not asked:
        raise InputError(
            "nobody held out was seen twice, so there is nothing to predict; hold out such subjects"
        )
    some = next(
        way.distances for case in next(iter(asked.values())) for way in case.ways.values() if way.distances
    )
    return {**{question: _record(found) for question, found in asked.items()}, **meaning(some)}


def _subjects(population: Population) -> list[str]:
    """Held-out subjects whose first visit is inside the observed ranges, those with most visits first."""
    rows = np.flatnonzero(population.held_out)
    counts = Counter(population.subjects[row] for row in rows)
    first = {population.subjects[row]: population.row(int(row)) for row in rows[::-1]}
    inside = [subject for subject in counts if is_inside(population, first[subject])]
    return sorted(inside, key=lambda subject: -counts[subject])


def _counterfactuals(atlas: Atlas, seen: HeldOut) -> list[HeldOut]:
    """The person of a visit on that day at somebody else's covariates; nobody where that is not known."""
    module, values = synthetic(atlas), _partner(atlas.population, seen)
    if module is None or values is None:
        return []
    return [HeldOut(values, _same_person_mm(atlas, module, seen, values), seen.subject, seen.visit)]


def _partner(population: Population, seen: HeldOut) -> dict[str, float] | None:
    """Covariates of the next held-out subject, the first following the last, with the same binary ones."""
    rows = np.flatnonzero(population.held_out)
    own = [row for row in rows if population.subjects[row] == seen.subject]
    binary = [c.name for c in population.covariates if c.kind == "binary"]
    for row in (*rows[rows > max(own)], *rows[rows < min(own)]):
        values = population.row(int(row))
        if all(values[name] == seen.values[name] for name in binary):
            return values
    return None


def _same_person_mm(
    atlas: Atlas, module: PopulationModule, seen: HeldOut, values: Mapping[str, float]
) -> Any:
    visit: Any = source_visits(atlas, module)[seen.subject, seen.visit]
    return aligned(atlas, *module.visit_shape(dataclasses.replace(visit, values=values)))


def _case(
    atlas: Atlas, seen: HeldOut, truth: HeldOut, fits: Sequence[Fit], should_stop: StopCheck | None
) -> Case:
    given, inferred = (_predicted(fit.at(truth.values, extrapolate=True), truth, should_stop) for fit in fits)
    kept, average = (
        _measured(atlas.shape(truth.values, code, extrapolate=True, should_stop=should_stop), None, truth)
        for code in (fits[0].latent, None)
    )
    return Case(seen, truth, dict(zip(WAYS, (given, inferred, kept, average), strict=True)))


def _predicted(person: Individual, truth: HeldOut, should_stop: StopCheck | None) -> Prediction:
    if should_stop is not None and should_stop():
        raise Cancelled
    return _measured(person.surface, person.volume_interval_cm3, truth)


def _measured(surface_mm: Any, interval_cm3: tuple[float, float] | None, truth: HeldOut) -> Prediction:
    distances = compare(truth.mesh_mm, surface_mm) if len(surface_mm.faces) else None
    return Prediction(distances, float(surface_mm.volume) / 1000, interval_cm3)


def _record(cases: Sequence[Case]) -> dict[str, Any]:
    ways = {}
    for way in WAYS:
        found = [case.ways[way].distances for case in cases]
        sure = [(_volume_cm3(case.truth), ends) for case in cases if (ends := case.ways[way].interval_cm3)]
        held = [low <= volume <= high for volume, (low, high) in sure]
        ways[way] = {
            **summary([one for one in found if one]),
            "held": float(np.mean(held)) if held else None,
            "width_cm3": float(np.median([high - low for _, (low, high) in sure])) if sure else None,
        }
    people = len({case.seen.subject for case in cases})
    return {"n": len(cases), "subjects": people, **ways, "cases": [_case_record(case) for case in cases]}


def _volume_cm3(shape: HeldOut) -> float:
    return float(shape.mesh_mm.volume) / 1000


def _case_record(case: Case) -> dict[str, Any]:
    return {
        "subject": case.seen.subject,
        "fitted_visit": case.seen.visit,
        "fitted_values": case.seen.values,
        "visit": case.truth.visit,
        "values": case.truth.values,
        "measured_cm3": _volume_cm3(case.truth),
        **{
            way: {"volume_cm3": one.volume_cm3, "interval_cm3": one.interval_cm3 and list(one.interval_cm3)}
            for way, one in case.ways.items()
        },
    }


def transfer_markdown(report: Mapping[str, Any], published: Sequence[Published] = ()) -> str:
    """The report of :func:`transfer` as tables.

    Args:
        report: also as read back from JSON.
        published: rows to show beside the measured ones of other visits.
    """
    sections = []
    for question, title in QUESTIONS.items():
        if question in report:
            beside = published if question == "visits" else ()
            sections.append(_question_table(title, report[question], beside))
    if "visits" in report:
        sections.append(_patient_table(report["visits"]["cases"]))
    sections.append(definitions(report, PUBLISHED_NOTE if published and "visits" in report else ""))
    return "\n\n".join(sections) + "\n"


def _question_table(title: str, record: Mapping[str, Any], published: Sequence[Published]) -> str:
    rows = [[label, *distance_cells(record[way]), *_interval(record[way])] for way, label in WAYS.items()]
    rows += [[f"published: {row.label}", *published_cells(row), "–", "–"] for row in published]
    header = ["", *COLUMNS.values(), "volume inside its 95 % interval", "median width of that, cm³"]
    size = f"{record['n']} shapes of {record['subjects']} held-out subjects, mean / median"
    return f"**{title}: {size}**\n\n{markdown_table(header, rows)}"


def _interval(record: Mapping[str, Any]) -> tuple[str, str]:
    if record["held"] is None:
        return "–", "–"
    width = record["width_cm3"]
    return f"{record['held']:.0%}", f"{width:,.0f}" if width > 100 else f"{width:.3g}"


def _patient_table(cases: Sequence[Mapping[str, Any]]) -> str:
    """The subject with most visits, as the paper's patient table."""
    own = [case for case in cases if case["subject"] == cases[0]["subject"]]
    names = list(own[0]["values"])
    first = own[0]["fitted_values"]
    rows = [
        [
            case["visit"],
            *(f"{case['values'][name]:.4g}" for name in names),
            f"{case['measured_cm3']:.1f}",
            *(_volume_cell(case[way]) for way in WAYS),
        ]
        for case in own
    ]
    fitted = ", ".join(f"{name} {first[name]:.4g}" for name in names)
    header = ["visit", *names, "measured, cm³", *(f"{label}, cm³" for label in WAYS.values())]
    title = f"**Volumes of {own[0]['subject']}, fitted at visit {own[0]['fitted_visit']} ({fitted})**"
    return f"{title}\n\n{markdown_table(header, rows)}"


def _volume_cell(way: Mapping[str, Any]) -> str:
    ends = way["interval_cm3"]
    return f"{way['volume_cm3']:.1f}" + (f" ({ends[0]:.1f} to {ends[1]:.1f})" if ends else "")
