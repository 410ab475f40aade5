"""Shape models beside each other: the same held-out shapes, the same truth, one table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from naisr_model.atlas import Atlas
from naisr_model.errors import InputError
from naisr_model.evaluation import published
from naisr_model.evaluation.held_out import opened
from naisr_model.evaluation.reports import (
    columns_of,
    definitions,
    distance_cells,
    markdown_table,
    published_cells,
)
from naisr_model.evaluation.studies.reconstruction import Question, Reconstruction
from naisr_model.progress import SILENT, Progress
from naisr_model.work.journal import Record

WAYS = {"given": "covariates given", "inferred": "covariates inferred"}


@dataclass(frozen=True)
class OfAtlas:
    """A question to one of the atlases.

    Attributes:
        number: of the atlas, in the order they were given.
        question: that it is asked.
    """

    number: int
    question: Question

    @property
    def key(self) -> str:
        """Number and question."""
        return f"atlas {self.number}: {self.question.key}"


@dataclass(frozen=True)
class Comparison:
    """Hold atlases of one population beside each other: fits of held-out shapes, effects, size and speed.

    Attributes:
        atlases: the .safetensors files.
        store: where their held-out shapes are; not needed for the synthetic populations, which are made
            again from their seed.
        limit: at most so many held-out shapes; 0 takes all.
    """

    atlases: tuple[Path, ...]
    _: KW_ONLY
    store: Path | None = None
    limit: int = 0

    def cases(self) -> list[OfAtlas]:
        """What :class:`~naisr_model.evaluation.studies.reconstruction.Reconstruction` asks, of each atlas.

        Raises:
            InputError: when they are of different people, or there are no held-out shapes to be had.
        """
        if len(self.atlases) < 2:
            raise InputError(f"{len(self.atlases)} atlas was given; a comparison needs two or more")
        first, *others = map(opened, self.atlases)
        for path, other in zip(self.atlases[1:], others, strict=True):
            if _people(other) != _people(first):
                raise InputError(
                    f"{path} was not trained on the people of {self.atlases[0]}, or others were held out; "
                    "compare atlases of one store"
                )
        return [
            OfAtlas(number, question)
            for number, study in enumerate(self._studies())
            for question in study.cases()
        ]

    def measure(self, case: OfAtlas, progress: Progress = SILENT) -> Record:
        """The answer of one atlas to one question.

        Raises:
            Cancelled: when nobody waits any more.
        """
        return {"atlas": case.number, **self._studies()[case.number].measure(case.question, progress)}

    def summarise(self, records: Sequence[Record]) -> Record:
        """The report.

        Returns:
            ``atlases``, of each its ``label``, how many ``weights`` it has and ``points`` it was trained on,
            the median of a fit's seconds by way (``fit_s``), and the ``report`` of a reconstruction.

        Raises:
            InputError: when no fit of an atlas has a surface.
        """
        parts = [[one for one in records if one["atlas"] == number] for number in range(len(self.atlases))]
        studies = zip(self.atlases, self._studies(), parts, strict=True)
        return {
            "atlases": [_row(opened(path), path, study.summarise(own), own) for path, study, own in studies]
        }

    def markdown(self, report: Mapping[str, Any]) -> str:
        """The tables of a report, also of one that was read back from JSON, with units and definitions."""
        atlases, first = report["atlases"], opened(self.atlases[0])
        beside = published.RECONSTRUCTION.get(first.name, ())
        sections = [
            _distances(atlases, beside),
            _truths(atlases, first.extent.title),
            _sizes(atlases),
            definitions(atlases[0]["report"], published.RECONSTRUCTION_NOTES.get(first.name, "")),
        ]
        return "\n\n".join(filter(None, sections)) + "\n"

    def _studies(self) -> list[Reconstruction]:
        return list(map(partial(Reconstruction, store=self.store, limit=self.limit), self.atlases))


def _people(atlas: Atlas) -> tuple[Any, ...]:
    people = atlas.checkpoint.population
    return people.subjects, people.visits, people.held_out.tolist(), atlas.frame


def _row(atlas: Atlas, path: Path, report: Record, records: Sequence[Record]) -> Record:
    training, weights = atlas.checkpoint.preset.training, atlas.checkpoint.weights.values()
    drawn = training.batch_shapes * training.shape_points
    return {
        "label": f"{atlas.checkpoint.model().title} ({path.stem})",
        "weights": sum(tensor.numel() for tensor in weights),
        "points": int(atlas.checkpoint.training["iterations"]) * drawn,
        "fit_s": {
            way: float(np.median([one["fit_s"] for one in records if one["part"] == way]))
            for way in WAYS
            if any(one["part"] == way for one in records)
        },
        "report": report,
    }


def _distances(atlases: Sequence[Mapping[str, Any]], beside: Sequence[published.Published]) -> str:
    rows = []
    for way, told in WAYS.items():
        for atlas in atlases:
            found = atlas["report"] if way == "given" else atlas["report"]["inferred"]
            knows = atlas["report"]["inferred"] is not None
            if found:
                label = f"{atlas['label']}, {told if knows else 'no covariates'}, {found['n']} shapes"
                rows.append([label, *distance_cells(found)])
    columns = columns_of(atlases[0]["report"])
    rows += [[f"published: {row.label}", *published_cells(row, columns)] for row in beside]
    return "**Held-out shapes refitted, mean / median**\n\n" + markdown_table(["", *columns.values()], rows)


def _truths(atlases: Sequence[Mapping[str, Any]], enclosed: str) -> str:
    """Mean and largest error of volumes or areas, mean HD, along the growth path and of single covariates."""
    names = dict.fromkeys(place["covariate"] for atlas in atlases for place in atlas["report"]["effects"])
    header = ["", "growth path", *[f"{name} alone" for name in names], "template"]
    rows = []
    for atlas in atlases:
        report = atlas["report"]
        own = [[place for place in report["effects"] if place["covariate"] == name] for name in names]
        template = [report["template"]] if report["template"] else []
        rows.append(
            [atlas["label"], *(_errors(each, enclosed) for each in (report["growth"], *own, template))]
        )
    if not any(atlas["report"]["growth"] for atlas in atlases):
        return ""
    return (
        f"**Beside the truth, z = 0: mean / largest error of the {enclosed}, and mean HD x10²**\n\n"
        + markdown_table(header, rows)
    )


def _errors(places: Sequence[Mapping[str, Any]], enclosed: str) -> str:
    if not places:
        return "–"
    errors = [abs(place[f"{enclosed}_error"]) for place in places]
    hausdorff = np.mean([place["hd_x100"] for place in places])
    told = f"{hausdorff:.2f}" if np.isfinite(hausdorff) else "no surface at some"
    return f"{100 * np.mean(errors):.1f} / {100 * max(errors):.1f} %, {told}"


def _sizes(atlases: Sequence[Mapping[str, Any]]) -> str:
    header = ["", "weights", "points trained on", "folded points", "components", "a fit, s: given / inferred"]
    rows = [
        [
            atlas["label"],
            f"{atlas['weights']:,}",
            f"{atlas['points'] / 1e6:.1f} million",
            "–"
            if atlas["report"]["folded_share"] is None
            else f"{100 * atlas['report']['folded_share']:.2f} %",
            " to ".join(f"{count}" for count in atlas["report"]["components"]),
            " / ".join(f"{atlas['fit_s'][way]:.1f}" for way in WAYS if way in atlas["fit_s"]),
        ]
        for atlas in atlases
    ]
    return "**Sizes**\n\n" + markdown_table(header, rows)
