"""Is an atlas true? Held-out shapes refitted, and where the population is synthetic, its effects checked."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Any

from naisr_model.atlas import Atlas
from naisr_model.covariates import Values
from naisr_model.errors import InputError
from naisr_model.evaluation import published
from naisr_model.evaluation.held_out import HeldOut, held_out, held_out_rows, opened, require_shapes
from naisr_model.evaluation.metrics import Distances, compare, component_count
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
from naisr_model.evaluation.soundness import components, folded_share, mean_displacement_mm, surface_places
from naisr_model.evaluation.truth import Place, beside_truth, truth_places
from naisr_model.frames import Extent
from naisr_model.progress import SILENT, Progress
from naisr_model.work.journal import Record

RESOLUTION = 192
"""Of the surfaces that are measured."""

CHECK_RESOLUTION = 96
"""Of the many surfaces whose components are counted."""


@dataclass(frozen=True)
class Question:
    """One thing to find out.

    Attributes:
        part: ``given`` or ``inferred``, a held-out shape refitted with its covariates known or not;
            ``growth``, ``effects`` or ``template``, a place held against the truth; ``plausible`` or
            ``corners``, a surface whose components are counted; ``folding``, ``displacement``.
        number: among those of its part.
        row: of the population, the held-out shape that is asked about, if any.
        place: in covariate space, if any.
    """

    part: str
    number: int
    row: int = -1
    place: Place | None = None

    @property
    def key(self) -> str:
        """Part, row and number."""
        return f"{self.part} {self.number}" if self.row < 0 else f"{self.part} row {self.row}"


@dataclass(frozen=True)
class Reconstruction:
    """Refit the held-out shapes, covariates given and inferred; check effects where the truth is known.

    Attributes:
        atlas: the .safetensors file.
        store: where its held-out shapes are; not needed for the synthetic populations, which are made
            again from their seed.
        limit: at most so many held-out shapes; 0 takes all.
    """

    atlas: Path
    _: KW_ONLY
    store: Path | None = None
    limit: int = 0

    def cases(self) -> list[Question]:
        """Every refit, every place of the truth, every surface that is looked at, and two of the template.

        What the model cannot do is not asked.

        Raises:
            InputError: when there are no held-out shapes to be had.
        """
        atlas = opened(self.atlas)
        require_shapes(atlas, self.store, self.limit)
        rows = held_out_rows(atlas, self.limit)
        return [*_refits(atlas, rows), *_places(atlas), *_of_the_template(atlas, rows[0])]

    def measure(self, case: Question, progress: Progress = SILENT) -> Record:
        """The answer to one question under the name of its part.

        Raises:
            Cancelled: when nobody waits any more.
        """
        return {"part": case.part, **self._answer(opened(self.atlas), case, progress)}

    def _answer(self, atlas: Atlas, case: Question, progress: Progress) -> Record:
        if case.part == "folding":
            return {"share": folded_share(atlas)}
        if case.row >= 0:
            shape = held_out(atlas, self.store, case.row)
            if case.part == "displacement":
                return {"lengths_mm": mean_displacement_mm(atlas, shape.mesh_mm)}
            return refitted(atlas, shape, shape.values if case.part == "given" else {}, progress)
        assert case.place is not None
        if case.part in ("plausible", "corners"):
            return {"components": components(atlas, case.place.values, CHECK_RESOLUTION, progress)}
        return {"place": beside_truth(atlas, case.place, RESOLUTION, progress).to_json()}

    def summarise(self, records: Sequence[Record]) -> Record:
        """The report.

        Returns:
            ``n`` shapes; ``cd_x100``, ``hd_x100``, ``vd_cm3`` and the other columns, each with ``mean`` and
            ``median``, and the same of the fits with nothing known under ``inferred``; ``truth_volume_error``
            by value of the growth path's covariate and ``effect_volume_error`` by covariate, each the signed
            error that is largest in magnitude, as a share of the true volume (of curves it is the area, also
            in both names); ``folded_share``, None of a model that deforms no template;
            ``components`` as ``[min, max]``; ``growth`` and ``effects``, the single places behind the errors;
            and the definitions.

        Raises:
            InputError: when no fit has a surface.
        """
        parts = {part: [one for one in records if one["part"] == part] for part in PARTS}
        given, inferred = (_distances(parts[way]) for way in ("given", "inferred"))
        if not given:
            raise InputError(
                "no fit of a held-out shape has a surface, so there is nothing to compare; train for longer"
            )
        growth, effects, template = (
            [record["place"] for record in parts[part]] for part in ("growth", "effects", "template")
        )
        enclosed = opened(self.atlas).extent.title
        looked_at = [*parts["given"], *parts["inferred"], *parts["plausible"]]
        return {
            **summary(given),
            "inferred": summary(inferred) if inferred else None,
            f"truth_{enclosed}_error": _worst(enclosed, ((f"{one['value']:g}", one) for one in growth)),
            f"effect_{enclosed}_error": _worst(enclosed, ((one["covariate"], one) for one in effects)),
            "folded_share": parts["folding"][0]["share"] if parts["folding"] else None,
            "components": _extremes(looked_at),
            "corner_components": _extremes(parts["corners"]),
            "without_surface": len(parts["given"] + parts["inferred"]) - len(given + inferred),
            "mean_displacement_mm": parts["displacement"][0]["lengths_mm"] if parts["displacement"] else {},
            "template": template[0] if template else None,
            "growth": growth,
            "effects": effects,
            **meaning(given[0]),
        }

    def markdown(self, report: Mapping[str, Any]) -> str:
        """The tables of a report, also of one that was read back from JSON, with units and definitions."""
        atlas = opened(self.atlas)
        title = atlas.checkpoint.model().title
        rows = [row for row in published.RECONSTRUCTION.get(atlas.name, ()) if row.model == title]
        ways = {"covariates given": report, "covariates inferred": report["inferred"]}
        sections = [
            _distance_table(ways if atlas.covariates else {"no covariates": report}, rows),
            _truth_table("Along the growth path, z = 0", report["growth"], atlas),
            _truth_table(
                "Effects of single covariates, the others at their mean, z = 0", report["effects"], atlas
            ),
            _checks(report, atlas),
            definitions(report, published.RECONSTRUCTION_NOTES.get(atlas.name, "")),
        ]
        return "\n\n".join(filter(None, sections)) + "\n"


PARTS = (
    *("given", "inferred"),
    *("growth", "effects", "template"),
    *("plausible", "corners"),
    *("folding", "displacement"),
)


def _refits(atlas: Atlas, rows: Sequence[int]) -> list[Question]:
    """With all covariates known and with none, which is the same where shapes depend on none."""
    ways = ("given", "inferred") if atlas.covariates else ("given",)
    return [Question(way, number, row) for way in ways for number, row in enumerate(rows)]


def _places(atlas: Atlas) -> list[Question]:
    surfaces = {
        part: [Place("", "", values) for values in found] for part, found in surface_places(atlas).items()
    }
    return [
        Question(part, number, place=place)
        for part, places in {**truth_places(atlas), **surfaces}.items()
        for number, place in enumerate(places)
    ]


def _of_the_template(atlas: Atlas, row: int) -> list[Question]:
    """What is asked of the whole atlas; the mean displacement is taken on the surface of a row."""
    can = atlas.capabilities
    return [
        *([Question("folding", 0)] if can.deformable else []),
        *([Question("displacement", 0, row)] if can.trackable else []),
    ]


def refitted(atlas: Atlas, shape: HeldOut, known: Values, progress: Progress = SILENT) -> Record:
    """A held-out shape fitted with some covariates known: its distances, if any, components and seconds."""
    fit = atlas.fit(shape.mesh_mm, known, extrapolate=True, progress=progress)
    values = {**fit.covariates, **known}
    surface = atlas.shape(values, fit.latent, RESOLUTION, extrapolate=True, progress=progress.quiet)
    found = compare(shape.mesh_mm, surface) if len(surface.faces) else None
    return {
        "distances": found and found.to_json(),
        "components": component_count(surface),
        "fit_s": fit.seconds,
    }


def _distances(records: Iterable[Record]) -> list[Distances]:
    return [Distances.from_json(record["distances"]) for record in records if record["distances"]]


def _extremes(records: Sequence[Record]) -> list[int]:
    counts = [record["components"] for record in records]
    return [min(counts), max(counts)] if counts else []


def _worst(enclosed: str, places: Iterable[tuple[str, Record]]) -> dict[str, float]:
    """The error of largest magnitude in what is enclosed, volume or area, under each key."""
    errors: dict[str, float] = {}
    for key, place in places:
        errors[key] = max(errors.get(key, 0.0), float(place[f"{enclosed}_error"]), key=abs)
    return errors


def _distance_table(ways: Mapping[str, Any], beside: Sequence[Published]) -> str:
    rows = [
        [f"this atlas, {record['n']} held-out shapes, {way}", *distance_cells(record)]
        for way, record in ways.items()
        if record
    ]
    columns = columns_of(next(iter(ways.values())))
    rows += [[f"published: {row.label}", *published_cells(row, columns)] for row in beside]
    return "**Reconstruction, mean / median**\n\n" + markdown_table(["", *columns.values()], rows)


def _truth_table(title: str, places: Sequence[Mapping[str, Any]], atlas: Atlas) -> str:
    if not places:
        return ""
    extent = atlas.extent
    own, true = f"{extent.title}, {extent.unit}", f"true {extent.title}, {extent.unit}"
    header = ["covariate", "value", "", own, true, "error", "HD x10²"]
    rows = [
        [
            place["covariate"],
            f"{place['value']:g}",
            place["condition"],
            *_beside_truth(place, extent),
            f"{100 * place[f'{extent.title}_error']:+.1f} %",
            f"{place['hd_x100']:.2f}",
        ]
        for place in places
    ]
    return f"**{title}**\n\n" + markdown_table(header, rows)


def _beside_truth(place: Mapping[str, Any], extent: Extent) -> tuple[str, str]:
    """What the atlas's shape encloses, and what the true one does."""
    return f"{place[extent.key()]:.2f}", f"{place[f'truth_{extent.suffix}']:.2f}"


def _checks(report: Mapping[str, Any], atlas: Atlas) -> str:
    least, most = report["components"]
    sentences = [
        f"Connected components: {least} to {most} (1 everywhere means no ghosts).",
    ]
    if report["folded_share"] is not None:
        sentences.append(f"Folded points near the surface: {100 * report['folded_share']:.2f} %.")
    if report["without_surface"]:
        sentences.append(f"Fits without any surface: {report['without_surface']}.")
    if report["corner_components"]:
        least, most = report["corner_components"]
        sentences.append(f"At the corners of the ranges, where no data are: {least} to {most} components.")
    if template := report["template"]:
        extent = atlas.extent
        own, true = (f"{number} {extent.unit}" for number in _beside_truth(template, extent))
        sentences.append(
            f"Template: {own}, true at the centre {true} "
            f"({100 * template[f'{extent.title}_error']:+.1f} %), HD x10² {template['hd_x100']:.2f}."
        )
    if shifts := report["mean_displacement_mm"]:
        listed = ", ".join(f"{name} {atlas.frame.length(shift, 2)}" for name, shift in shifts.items())
        sentences.append(f"Mean displacement over the population, which centring keeps small: {listed}.")
    return " ".join(sentences)
