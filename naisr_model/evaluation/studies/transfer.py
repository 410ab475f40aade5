"""Does a fit tell how a person looks at other covariates? The paper's shape transfer, held against the truth.

Two questions are asked. *Other visits*: the first visit of a held-out subject is fitted and each later one
predicted at its covariates, as in the paper; what changes from day to day, such as the position of the head,
is in the truth and cannot be predicted. *Same person, other covariates*: of a synthetic population the
generator knows what the fitted person looks like, on the same day, with somebody else's age and weight, also
where everybody was seen once; there what a fit leaves out as not lasting counts against it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from naisr_model.atlas import Atlas, Fit
from naisr_model.covariates import Population
from naisr_model.errors import InputError
from naisr_model.evaluation import published
from naisr_model.evaluation.held_out import (
    HeldOut,
    aligned,
    held_out,
    held_out_rows,
    known_population,
    opened,
    require_shapes,
    source_visits,
    synthetic,
)
from naisr_model.evaluation.metrics import Distances, compare
from naisr_model.evaluation.published import Published
from naisr_model.evaluation.reports import (
    columns_of,
    definitions,
    distance_cells,
    markdown_table,
    meaning,
    published_cells,
    summary,
)
from naisr_model.frames import Extent
from naisr_model.progress import SILENT, Progress
from naisr_model.shapes.kinds import Shape
from naisr_model.work.journal import Record

WAYS = {
    "given": "fitted, covariates given",
    "inferred": "fitted, covariates inferred",
    "kept": "fitted, covariates given, the whole code kept as in the paper",
    "average": "no fit: the population's average at the same covariates",
}
QUESTIONS = {"visits": "Other visits", "counterfactuals": "Same person, other covariates"}


@dataclass(frozen=True)
class HeldOutSubject:
    """A held-out person, by name."""

    name: str

    @property
    def key(self) -> str:
        """The name."""
        return self.name


@dataclass(frozen=True)
class Transfer:
    """Fit held-out subjects once and predict them at other visits and other covariates.

    A fit is shown at the other covariates themselves, whether its own were given or inferred, with what is
    expected to last of its code; beside it stands the paper's transfer, which keeps the whole code. (To
    inferred covariates the paper adds the change of the true ones; where a shape hardly tells the age, as a
    grown-up's does, this carries the error of the age along.) In the second question the covariates
    are those of the next held-out subject with the same binary ones, so that they are plausible together;
    the truth is what the synthetic population makes of the fitted visit's own variation at them. Subjects
    whose first visit is outside the observed ranges are left out.

    Attributes:
        atlas: the .safetensors file.
        store: where its held-out shapes are; not needed for the synthetic populations, which are made
            again from their seed.
        limit: at most so many subjects, those with most visits first; 0 takes all.
    """

    atlas: Path
    _: KW_ONLY
    store: Path | None = None
    limit: int = 0

    def cases(self) -> list[HeldOutSubject]:
        """The held-out subjects of whom there is something to predict.

        Raises:
            InputError: when there is nobody, or the model carries no shape to other covariates.
        """
        atlas = opened(self.atlas)
        if not atlas.capabilities.transferable:
            raise InputError(
                f"{atlas.model_title} does not carry shapes to other covariates, so there is no transfer to "
                "evaluate; give an atlas of another model"
            )
        require_shapes(atlas, self.store, self.limit)
        chosen = _subjects(atlas.population)[: self.limit or None]
        asked = [name for name in chosen if len(_rows(atlas, name)) > 1 or _partner(atlas, name)]
        if not asked:
            raise InputError(
                "nobody held out was seen twice, so there is nothing to predict; prepare with a larger "
                "--held-out or another --seed"
            )
        return [HeldOutSubject(name) for name in asked]

    def measure(self, case: HeldOutSubject, progress: Progress = SILENT) -> Record:
        """One subject fitted at the first visit and predicted elsewhere, for each of :data:`QUESTIONS`.

        Raises:
            Cancelled: when nobody waits any more.
        """
        atlas = opened(self.atlas)
        seen, *later = (held_out(atlas, self.store, row) for row in _rows(atlas, case.name))
        fits = [
            atlas.fit(seen.mesh_mm, known, progress=piece)
            for known, piece in progress.part(0.0, 0.5).over([seen.values, {}])
        ]
        truths = {"visits": later, "counterfactuals": _counterfactuals(atlas, seen)}
        return {
            question: [
                _predictions(atlas, seen, truth, fits, piece)
                for truth, piece in progress.part(0.5, 1.0).over(targets)
            ]
            for question, targets in truths.items()
        }

    def summarise(self, records: Sequence[Record]) -> Record:
        """The report.

        Returns:
            For each of :data:`QUESTIONS` that can be asked a record with a :func:`~.reports.summary` and the
            share ``held`` of volumes inside their interval and its median ``width_cm3`` for each of
            :data:`WAYS`, and ``cases`` with the volumes in cm³; and what the columns mean.

        Raises:
            InputError: when no prediction has a surface.
        """
        asked = {name: [one for record in records for one in record[name]] for name in QUESTIONS}
        everything = [one[way] for found in asked.values() for one in found for way in WAYS]
        some = next((distances for one in everything for distances in _distances([one])), None)
        if some is None:
            raise InputError("no prediction has a surface, so there is nothing to compare; train for longer")
        extent = opened(self.atlas).extent
        return {**{name: _record(found, extent) for name, found in asked.items() if found}, **meaning(some)}

    def markdown(self, report: Mapping[str, Any]) -> str:
        """The report as tables, also of one that was read back from JSON."""
        atlas = opened(self.atlas)
        extent, rows = atlas.extent, published.TRANSFER.get(atlas.name, ()) if "visits" in report else ()
        sections = []
        for question, title in QUESTIONS.items():
            if question in report:
                beside = rows if question == "visits" else ()
                sections.append(_question_table(title, report[question], beside, extent))
        if "visits" in report:
            sections.append(_patient_table(report["visits"]["cases"], extent))
        sections.append(definitions(report, published.TRANSFER_NOTE if rows else ""))
        return "\n\n".join(sections) + "\n"


def _subjects(population: Population) -> list[str]:
    """Held-out subjects whose first visit is inside the observed ranges, those with most visits first."""
    rows = np.flatnonzero(population.held_out)
    counts = Counter(population.subjects[row] for row in rows)
    first = {population.subjects[row]: population.row(int(row)) for row in rows[::-1]}
    inside = [subject for subject in counts if population.contains(first[subject])]
    return sorted(inside, key=lambda subject: -counts[subject])


def _rows(atlas: Atlas, subject: str) -> list[int]:
    """The rows of a subject's visits."""
    return held_out_rows(atlas, subjects=[subject])


def _counterfactuals(atlas: Atlas, seen: HeldOut) -> list[HeldOut]:
    """The person of a visit on that day at somebody else's covariates; nobody where that is not known."""
    values = _partner(atlas, seen.subject)
    if values is None:
        return []
    return [HeldOut(values, _same_person_mm(atlas, seen, values), seen.subject, seen.visit)]


def _partner(atlas: Atlas, subject: str) -> dict[str, float] | None:
    """Covariates of the next held-out subject, the first following the last, with the same binary ones.

    None where nobody is like that, or nobody knows what the subject looks like at them.
    """
    people = atlas.population
    rows, own = np.flatnonzero(people.held_out), _rows(atlas, subject)
    first = people.row(own[0])
    binary = [c.name for c in people.covariates if c.kind == "binary"]
    others = map(people.row, map(int, (*rows[rows > max(own)], *rows[rows < min(own)])))
    like = (values for values in others if all(values[name] == first[name] for name in binary))
    return None if synthetic(atlas) is None else next(like, None)


def _same_person_mm(atlas: Atlas, seen: HeldOut, values: Mapping[str, float]) -> Shape:
    visit: Any = source_visits(atlas)[seen.subject, seen.visit]
    return aligned(atlas, *known_population(atlas).visit_shape(replace(visit, values=values)))


def _predictions(
    atlas: Atlas, seen: HeldOut, truth: HeldOut, fits: Sequence[Fit], progress: Progress
) -> Record:
    """A person seen once, and predicted elsewhere in every way of :data:`WAYS`."""
    ways = {}
    for way, fit in zip(("given", "inferred"), fits, strict=True):
        progress.check()
        person = fit.at(truth.values, extrapolate=True)
        ways[way] = _measured(atlas.extent, person.surface, person.extent_interval, truth)
    for way, code in (("kept", fits[0].latent), ("average", None)):
        surface = atlas.shape(truth.values, code, extrapolate=True, progress=progress.quiet)
        ways[way] = _measured(atlas.extent, surface, None, truth)
    return {
        "subject": seen.subject,
        "fitted_visit": seen.visit,
        "fitted_values": seen.values,
        "visit": truth.visit,
        "values": truth.values,
        f"measured_{atlas.extent.suffix}": atlas.extent.of(truth.mesh_mm),
        **ways,
    }


def _measured(
    extent: Extent, surface_mm: Shape, interval: tuple[float, float] | None, truth: HeldOut
) -> Record:
    """One way to predict a shape: the distances from the truth are missing where nothing was predicted."""
    distances = compare(truth.mesh_mm, surface_mm) if len(surface_mm.faces) else None
    return {
        extent.key(): extent.of(surface_mm),
        f"interval_{extent.suffix}": interval and list(interval),
        "distances": distances and distances.to_json(),
    }


def _record(cases: Sequence[Record], extent: Extent) -> Record:
    ways, measured, interval = {}, f"measured_{extent.suffix}", f"interval_{extent.suffix}"
    for way in WAYS:
        sure = [(case[measured], ends) for case in cases if (ends := case[way][interval])]
        held = [low <= volume <= high for volume, (low, high) in sure]
        ways[way] = {
            **summary(_distances([case[way] for case in cases])),
            "held": float(np.mean(held)) if held else None,
            f"width_{extent.suffix}": float(np.median([high - low for _, (low, high) in sure]))
            if sure
            else None,
        }
    people = len({case["subject"] for case in cases})
    return {"n": len(cases), "subjects": people, **ways, "cases": [_extents(case, extent) for case in cases]}


def _distances(predictions: Sequence[Record]) -> list[Distances]:
    return [Distances.from_json(one["distances"]) for one in predictions if one["distances"]]


def _extents(case: Record, extent: Extent) -> Record:
    """A case without its distances."""
    keys = (extent.key(), f"interval_{extent.suffix}")
    ways = {way: {key: case[way][key] for key in keys} for way in WAYS}
    return {**case, **ways}


def _question_table(
    title: str, record: Mapping[str, Any], beside: Sequence[Published], extent: Extent
) -> str:
    rows = [
        [label, *distance_cells(record[way]), *_interval(record[way], extent)] for way, label in WAYS.items()
    ]
    columns = columns_of(record["given"])
    rows += [[f"published: {row.label}", *published_cells(row, columns), "–", "–"] for row in beside]
    inside, width = f"{extent.title} inside its 95 % interval", f"median width of that, {extent.unit}"
    header = ["", *columns.values(), inside, width]
    size = f"{record['n']} shapes of {record['subjects']} held-out subjects, mean / median"
    return f"**{title}: {size}**\n\n{markdown_table(header, rows)}"


def _interval(record: Mapping[str, Any], extent: Extent) -> tuple[str, str]:
    if record["held"] is None:
        return "–", "–"
    width = record[f"width_{extent.suffix}"]
    return f"{100 * record['held']:.0f} %", f"{width:,.0f}" if width > 100 else f"{width:.3g}"


def _patient_table(cases: Sequence[Mapping[str, Any]], extent: Extent) -> str:
    """The subject with most visits, as the paper's patient table."""
    own = [case for case in cases if case["subject"] == cases[0]["subject"]]
    names = list(own[0]["values"])
    first = own[0]["fitted_values"]
    rows = [
        [
            case["visit"],
            *(f"{case['values'][name]:.4g}" for name in names),
            _cell(case[f"measured_{extent.suffix}"], extent),
            *(_extent_cell(case[way], extent) for way in WAYS),
        ]
        for case in own
    ]
    fitted = ", ".join(f"{name} {first[name]:.4g}" for name in names)
    header = ["visit", *names, *(f"{label}, {extent.unit}" for label in ("measured", *WAYS.values()))]
    whose = f"{own[0]['subject']}, fitted at visit {own[0]['fitted_visit']} ({fitted})"
    title = f"**{extent.title.capitalize()}s of {whose}**"
    return f"{title}\n\n{markdown_table(header, rows)}"


def _extent_cell(way: Mapping[str, Any], extent: Extent) -> str:
    ends = way[f"interval_{extent.suffix}"]
    interval = f" ({' to '.join(_cell(end, extent) for end in ends)})" if ends else ""
    return _cell(way[extent.key()], extent) + interval


def _cell(value: float, extent: Extent) -> str:
    """A number of a table whose header has the unit."""
    return extent.told(value).removesuffix(f" {extent.unit}")
