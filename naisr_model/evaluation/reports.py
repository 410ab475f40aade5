"""Turns measured distances into the JSON record of an evaluation, and that record into readable tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from naisr_model.errors import InputError
from naisr_model.evaluation.metrics import Distances

DEFINITIONS = {
    "cd_x100": "Chamfer distance: sum of the two mean squared nearest-neighbour distances, x 100",
    "hd_x100": "Hausdorff distance: the larger of the two one-sided maxima, x 100",
    "hd95_x100": "as HD with the one-sided 95th percentiles, x 100",
    "emd_x100": "earth mover's distance: mean ground distance of the exact one-to-one assignment, x 100; "
    "random samples of one and the same surface are not at 0",
    "mean_mm": "mean of the two one-sided mean nearest-neighbour distances, in mm, not scaled",
    "vd_cm3": "absolute volume difference in cm³",
}
"""What each measured column of the record means; ``scale`` below applies to the ``_x100`` ones."""

SCALE = "both shapes divided by the target's largest distance from its centre"

COLUMNS = {
    "cd_x100": "CD x10²",
    "hd_x100": "HD x10²",
    "hd95_x100": "HD95 x10²",
    "emd_x100": "EMD x10²",
    "mean_mm": "mean distance, mm",
    "vd_cm3": "VD, cm³",
}

PUBLISHED_RECONSTRUCTION = (
    "NAISR (ICLR 2024), Table 2, real airways from CT, so other shapes than these; "
    "its EMD is as published and not comparable with an exact balanced one"
)

Record = dict[str, Any]


@dataclass(frozen=True)
class TruthPoint:
    """The population shape of the atlas beside the true one, at one place in covariate space.

    Attributes:
        covariate: the one that varies along the path, or whose effect is shown.
        value: its real value.
        condition: what else defines the place, for example ``boys``; empty where nothing does.
        volume_cm3: volume of the atlas's shape at z = 0.
        truth_cm3: volume of the true shape without individual variation.
        hd_x100: Hausdorff distance from the true shape, as in :class:`Distances`.
    """

    covariate: str
    value: float
    condition: str
    volume_cm3: float
    truth_cm3: float
    hd_x100: float

    @property
    def volume_error(self) -> float:
        """Signed error of the volume as a share of the true one."""
        return self.volume_cm3 / self.truth_cm3 - 1


Pair = tuple[float, float]


@dataclass(frozen=True)
class Published:
    """Mean and median of a published result; None where nothing was published.

    Attributes:
        label: what was measured.
        cd_x100: Chamfer distance, x 100.
        emd_x100: as published, x 100; smaller than any exact balanced EMD of such shapes can be.
        hd_x100: Hausdorff distance, x 100.
        vd_cm3: volume difference in cubic centimetres.
    """

    label: str
    cd_x100: Pair | None = None
    emd_x100: Pair | None = None
    hd_x100: Pair | None = None
    vd_cm3: Pair | None = None


PUBLISHED_AIRWAY = (
    Published("NAISR, covariates given", (0.084, 0.044), (1.345, 1.190), (10.719, 8.577)),
    Published("NAISR, covariates inferred", (0.067, 0.039), (1.233, 1.132), (10.333, 8.404)),
)
"""NAISR (ICLR 2024), Table 2, paediatric airways segmented from CT."""

PUBLISHED_AIRWAY_TRANSFER = (
    Published("NAISR, covariates given", vd_cm3=(11.23, 9.65)),
    Published("NAISR, covariates inferred", vd_cm3=(12.82, 8.84)),
)
"""NAISR (ICLR 2024), Table 3, other visits of the patients of Table 2."""


def reconstruction_report(
    distances: Sequence[Distances],
    *,
    components: Sequence[int],
    folded_share: float,
    inferred: Sequence[Distances] = (),
    growth: Sequence[TruthPoint] = (),
    effects: Sequence[TruthPoint] = (),
    template: TruthPoint | None = None,
    corner_components: Sequence[int] = (),
    mean_displacement_mm: Mapping[str, float] = MappingProxyType({}),
    without_surface: int = 0,
) -> Record:
    """The record that ``naisr evaluate reconstruction --json`` writes.

    Args:
        distances: one per held-out shape, refitted with its covariates given.
        components: connected components of every surface that was looked at.
        folded_share: share of the points near the surface where p -> p + d(p) folds.
        inferred: the same, refitted with nothing known.
        growth: along the population growth path, where the truth is known.
        effects: of single covariates with the others at their mean, where the truth is known.
        template: beside the true shape at the population centre, where that is known.
        corner_components: connected components at the corners of the box of ranges, where no data are.
        mean_displacement_mm: length of the mean of each covariate's displacement over the population.
        without_surface: fits that have no surface at all; they have no distances.

    Returns:
        Plain JSON types. ``n`` shapes; ``cd_x100``, ``hd_x100``, ``vd_cm3`` and the other columns, each
        with ``mean`` and ``median``, and the same of the fits with nothing known under ``inferred``;
        ``truth_volume_error`` by value of the growth path's covariate and ``effect_volume_error`` by
        covariate, each the signed error that is largest in magnitude, as a share of the true volume;
        ``folded_share``; ``components`` as ``[min, max]``; ``growth`` and ``effects``, the single places
        behind the errors; and the definitions.

    Raises:
        InputError: when no shape was measured.
    """
    if not distances or not components:
        raise InputError(
            "no shape was held out, so there is nothing to evaluate; split the data by patient first"
        )
    return {
        **summary(distances),
        "inferred": summary(inferred) if inferred else None,
        "truth_volume_error": _worst((f"{point.value:g}", point) for point in growth),
        "effect_volume_error": _worst((point.covariate, point) for point in effects),
        "folded_share": float(folded_share),
        "components": _extremes(components),
        "corner_components": _extremes(corner_components),
        "without_surface": int(without_surface),
        "mean_displacement_mm": dict(mean_displacement_mm),
        "template": None if template is None else _place(template),
        "growth": [_place(point) for point in growth],
        "effects": [_place(point) for point in effects],
        **meaning(distances[0]),
    }


def summary(distances: Sequence[Distances]) -> Record:
    """How many there are, ``n``, and the mean and the median of each column."""
    columns = {name: mean_and_median([getattr(item, name) for item in distances]) for name in COLUMNS}
    return {"n": len(distances), **columns}


def mean_and_median(values: Sequence[float]) -> Record:
    """Both, by name."""
    return {"mean": float(np.mean(values)), "median": float(np.median(values))}


def meaning(distances: Distances) -> Record:
    """What a reader of a record must know of its columns."""
    counts = {"samples": distances.samples, "emd_samples": distances.emd_samples}
    return {**counts, "scale": SCALE, "definitions": dict(DEFINITIONS)}


def reconstruction_markdown(report: Mapping[str, Any], published: Sequence[Published] = ()) -> str:
    """The tables of a record as Markdown, with units and definitions.

    Args:
        report: from :func:`reconstruction_report`, or read back from its JSON.
        published: rows to show beside the measured one, marked as published.
    """
    sections = [
        _distance_table(report, published),
        _truth_table("Along the growth path, z = 0", report["growth"]),
        _truth_table("Effects of single covariates, the others at their mean, z = 0", report["effects"]),
        _checks(report),
        definitions(report, PUBLISHED_RECONSTRUCTION if published else ""),
    ]
    return "\n\n".join(filter(None, sections)) + "\n"


def _extremes(counts: Sequence[int]) -> list[int]:
    return [int(min(counts)), int(max(counts))] if counts else []


def _worst(points: Iterable[tuple[str, TruthPoint]]) -> dict[str, float]:
    """The volume error of largest magnitude under each key."""
    errors: dict[str, float] = {}
    for key, point in points:
        errors[key] = max(errors.get(key, 0.0), float(point.volume_error), key=abs)
    return errors


def _place(point: TruthPoint) -> Record:
    return {**asdict(point), "volume_error": point.volume_error}


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table; the first column holds words, the others numbers."""
    lines = [header, ["---", *["---:"] * (len(header) - 1)], *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _distance_table(report: Mapping[str, Any], published: Sequence[Published]) -> str:
    ways = {"given": report, "inferred": report["inferred"]}
    rows = [
        [f"this atlas, {record['n']} held-out shapes, covariates {way}", *distance_cells(record)]
        for way, record in ways.items()
        if record
    ]
    rows += [[f"published: {row.label}", *published_cells(row)] for row in published]
    return "**Reconstruction, mean / median**\n\n" + markdown_table(["", *COLUMNS.values()], rows)


def distance_cells(record: Mapping[str, Any]) -> list[str]:
    """Mean and median of each column of a :func:`summary`."""
    return [pair_cell(record[name]) for name in COLUMNS]


def pair_cell(record: Mapping[str, float]) -> str:
    """What :func:`mean_and_median` gave, in three digits or more."""
    return " / ".join(
        f"{record[k]:.3g}" if record[k] < 1000 else f"{record[k]:,.0f}" for k in ("mean", "median")
    )


def published_cells(row: Published) -> list[str]:
    """Every digit that was published, and a dash where nothing was."""
    pairs = [getattr(row, name, None) for name in COLUMNS]
    return [f"{pair[0]:g} / {pair[1]:g}" if pair else "–" for pair in pairs]


def _truth_table(title: str, places: Sequence[Mapping[str, Any]]) -> str:
    if not places:
        return ""
    header = ["covariate", "value", "", "volume, cm³", "true volume, cm³", "error", "HD x10²"]
    rows = [
        [
            place["covariate"],
            f"{place['value']:g}",
            place["condition"],
            f"{place['volume_cm3']:.2f}",
            f"{place['truth_cm3']:.2f}",
            f"{place['volume_error']:+.1%}",
            f"{place['hd_x100']:.2f}",
        ]
        for place in places
    ]
    return f"**{title}**\n\n" + markdown_table(header, rows)


def _checks(report: Mapping[str, Any]) -> str:
    least, most = report["components"]
    sentences = [
        f"Connected components: {least} to {most} (1 everywhere means no ghosts).",
        f"Folded points near the surface: {report['folded_share']:.2%}.",
    ]
    if report["without_surface"]:
        sentences.append(f"Fits without any surface: {report['without_surface']}.")
    if report["corner_components"]:
        least, most = report["corner_components"]
        sentences.append(f"At the corners of the ranges, where no data are: {least} to {most} components.")
    if template := report["template"]:
        sentences.append(
            f"Template: {template['volume_cm3']:.2f} cm³, true at the centre {template['truth_cm3']:.2f} cm³ "
            f"({template['volume_error']:+.1%}), HD x10² {template['hd_x100']:.2f}."
        )
    if shifts := report["mean_displacement_mm"]:
        listed = ", ".join(f"{name} {shift:.2f} mm" for name, shift in shifts.items())
        sentences.append(f"Mean displacement over the population, which centring keeps small: {listed}.")
    return " ".join(sentences)


def definitions(report: Mapping[str, Any], published: str = "") -> str:
    """What the columns of a record with :func:`meaning` are; ``published`` says it of published rows."""
    lines = [f"- {COLUMNS[name]}: {text}." for name, text in report["definitions"].items()]
    lines.append(
        f"- x10²: {report['scale']}; {report['samples']:,} surface samples of each shape, "
        f"{report['emd_samples']:,} for EMD."
    )
    if published:
        lines.append(f"- published: {published}.")
    return "\n".join(lines)
