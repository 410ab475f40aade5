"""What the reports of several studies have in common: summaries of distances, and their tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from naisr_model.evaluation.metrics import METRICS, Distances, all_metrics
from naisr_model.evaluation.published import Published
from naisr_model.work.journal import Record

DEFINITIONS = {metric.key: metric.definition for metric in METRICS}
"""What each measured column of the record means; ``scale`` below applies to the ``_x100`` ones."""

SCALE = "both shapes divided by the target's largest distance from its centre"

COLUMNS = {metric.key: metric.column for metric in METRICS}
"""Of surfaces."""

ALL_COLUMNS = {metric.key: metric.column for metric in all_metrics()}
ALL_DEFINITIONS = {metric.key: metric.definition for metric in all_metrics()}


def columns_of(record: Mapping[str, Any]) -> dict[str, str]:
    """The columns that a :func:`summary`, or a record with :func:`meaning`, has."""
    return {key: column for key, column in ALL_COLUMNS.items() if key in record}


def summary(distances: Sequence[Distances]) -> Record:
    """How many there are, ``n``, and the mean and the median of each column."""
    names = list(distances[0].values if distances else COLUMNS)
    columns = {name: mean_and_median([item[name] for item in distances]) for name in names}
    return {"n": len(distances), **columns}


def mean_and_median(values: Sequence[float]) -> Record:
    """Both, by name."""
    return {"mean": float(np.mean(values)), "median": float(np.median(values))}


def meaning(distances: Distances) -> Record:
    """What a reader of a record must know of its columns."""
    counts = {"samples": distances.samples, "emd_samples": distances.emd_samples}
    told = {name: ALL_DEFINITIONS[name] for name in distances.values}
    return {**counts, "scale": SCALE, "definitions": told}


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table; the first column holds words, the others numbers."""
    lines = [header, ["---", *["---:"] * (len(header) - 1)], *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def distance_cells(record: Mapping[str, Any]) -> list[str]:
    """Mean and median of each column of a :func:`summary`."""
    return [pair_cell(record[name]) for name in columns_of(record)]


def pair_cell(record: Mapping[str, float]) -> str:
    """What :func:`mean_and_median` gave, in three digits or more."""
    return " / ".join(
        f"{record[k]:.3g}" if record[k] < 1000 else f"{record[k]:,.0f}" for k in ("mean", "median")
    )


def published_cells(row: Published, columns: Iterable[str] = COLUMNS) -> list[str]:
    """Every digit that was published, and a dash where nothing was."""
    pairs = [getattr(row, name, None) for name in columns]
    return [f"{pair[0]:g} / {pair[1]:g}" if pair else "–" for pair in pairs]


def definitions(report: Mapping[str, Any], published: str = "") -> str:
    """What the columns of a record with :func:`meaning` are; ``published`` says it of published rows."""
    lines = [f"- {ALL_COLUMNS[name]}: {text}." for name, text in report["definitions"].items()]
    lines.append(
        f"- x10²: {report['scale']}; {report['samples']:,} surface samples of each shape, "
        f"{report['emd_samples']:,} for EMD."
    )
    if published:
        lines.append(f"- published: {published}.")
    return "\n".join(lines)
