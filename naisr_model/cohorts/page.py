"""What became of a cohort on one page: an HTML file that holds its pictures and needs nothing else.

The farthest from what is usual stand first: they are either errors or what the study is about.
"""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from naisr_model.atlas import Atlas
from naisr_model.cohorts.results import Cohort, Outcome
from naisr_model.covariates import Covariate, Values, growth_path, interval_in_words
from naisr_model.errors import InputError
from naisr_model.measures.curves import shapes_along
from naisr_model.measures.kinds import VOLUME

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHOWN = 50
"""Rows of a table on the page; all are in the results."""

USUAL = (
    "Lines and bands: half, and 95 %, of the people behind the atlas, whose other covariates are as usual."
)
SCANS = "Dots: scans whose value is known; crosses: those of which it was inferred."

PLACES = 24
"""Of the curve along a covariate."""

STYLE: dict[Any, Any] = {"font.size": 9, "svg.fonttype": "none", "svg.hashsalt": "cohort"}
POINT = "#2f6fb3"
COLOURS = (POINT, "#c0562f")
"""Of the two levels of a covariate, told apart by those who see no red or green too."""

HEAD = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>
body {{ font: 14px/1.5 system-ui, sans-serif; color: #1d2430; max-width: 1100px; margin: 2em auto;
       padding: 0 1em }}
table {{ border-collapse: collapse; width: 100% }}
th, td {{ text-align: left; padding: 0.3em 0.8em 0.3em 0; border-bottom: 1px solid #d8dce3;
         vertical-align: top }}

svg {{ max-width: 100%; height: auto }}
</style></head><body>
"""


def page(cohort: Cohort) -> bytes:
    """The page, UTF-8; the same for the same results."""
    title = f"{cohort.table.name}: {len(cohort.fitted)} of {len(cohort.outcomes)} scans fitted"
    parts = [HEAD.format(title=escape(title)), f"<h1>{escape(title)}</h1>", *_paragraphs(cohort)]
    legend = SCANS if cohort.norms is None else f"{USUAL} {SCANS}"
    if cohort.fitted:
        parts += ["<h2>Residuals</h2>", _picture(lambda axes: _draw_residuals(axes, cohort))]
        for covariate in cohort.atlas.covariates:
            if covariate.kind == "continuous":
                parts += [
                    f"<h2>Along {escape(covariate.name)}</h2>",
                    _along(cohort, covariate),
                    f"<p>{legend}</p>",
                ]
        parts += ["<h2>The most unusual first</h2>", _table(*_unusual(cohort))]
    if cohort.rejected:
        parts += ["<h2>Rejected</h2>", _table(*_rejected(cohort))]
    return "\n".join([*parts, "</body></html>\n"]).encode()


def unusualness(cohort: Cohort) -> NDArray[np.float64]:
    """How far each of the fitted lies from what is usual, in standard deviations.

    That is the largest of the distances of its measures from those of people with the same covariates, and of
    how much worse than the cohort's its residual is: the logarithm's distance from the median, in units of
    1.4826 times the median distance, which is a standard deviation where they are normally distributed.
    """
    residuals = np.log([max(one.record[cohort.residual], 1e-12) for one in cohort.fitted])
    away = residuals - np.median(residuals)
    spread = 1.4826 * float(np.median(np.abs(away)))
    worse = away / spread if spread > 0 else np.zeros_like(away)
    scores = [
        max((abs(each.get("z", 0.0)) for each in one.record["measures"].values()), default=0.0)
        for one in cohort.fitted
    ]
    return np.maximum(worse, scores)


def _paragraphs(cohort: Cohort) -> Iterable[str]:
    atlas = cohort.atlas
    seconds = sum(one.record["seconds"] for one in cohort.fitted)
    lines = [*cohort.table.summary, f"fitted with the atlas '{atlas.name}' ({atlas.model_title})"]
    if cohort.fitted:
        lines.append(f"{seconds / len(cohort.fitted):.1f} s a scan")
    if cohort.without:
        lines.append(cohort.without)
    yield f"<p>{'<br>'.join(escape(line.strip()) for line in lines)}</p>"
    remarks = Counter(text for one in cohort.fitted for text in one.remarks)
    if remarks:
        items = "".join(f"<li>{count} × {escape(text)}</li>" for text, count in remarks.most_common(SHOWN))
        yield f"<p>Remarks:</p><ul>{items}</ul>"


def _picture(draw: Any) -> str:
    """A picture as SVG, to stand in the page."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    text = io.StringIO()
    with rc_context(STYLE):
        figure = Figure(figsize=(7.5, 3.4), layout="constrained")
        axes = figure.subplots()
        axes.spines[["top", "right"]].set_visible(False)
        draw(axes)
        figure.savefig(text, format="svg", metadata={"Date": None})
    return "".join(text.getvalue().partition("<svg")[1:])


def _draw_residuals(axes: Axes, cohort: Cohort) -> None:
    from matplotlib.ticker import MaxNLocator

    residuals = [one.record[cohort.residual] for one in cohort.fitted]
    axes.hist(residuals, bins=min(40, 5 + len(residuals) // 2), color=POINT, edgecolor="white")
    axes.set_xlabel(f"mean distance of the scan to its fit [{cohort.atlas.frame.unit}]")
    axes.set_ylabel("scans")
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))


def _along(cohort: Cohort, covariate: Covariate) -> str:
    return _picture(lambda axes: _draw_along(axes, cohort, covariate))


def _draw_along(axes: Axes, cohort: Cohort, covariate: Covariate) -> None:
    """The cohort over what 95 % of people have, the other covariates growing with the one drawn along."""
    extent = cohort.atlas.extent
    for (label, fixed), colour in zip(_groups(cohort.atlas), COLOURS, strict=False):
        if (usual := _usual_along(cohort, covariate, fixed)) is not None:
            places, middle, low, high = usual
            axes.fill_between(places, low, high, color=colour, alpha=0.25, linewidth=0)
            axes.plot(places, middle, color=colour, label=f"usual, {label}" if label else "usual")
        for is_inferred, mark in ((False, "o"), (True, "x")):
            chosen = [
                one.record
                for one in cohort.fitted
                if (covariate.name in one.record["inferred"]) == is_inferred
                and all(one.record["covariates"][name] * side > 0 for name, side in fixed.items())
            ]
            where = [record["covariates"][covariate.name] for record in chosen]
            axes.plot(where, [record[extent.key()] for record in chosen], mark, color=colour)
    axes.set_xlabel(f"{covariate.name} [{covariate.unit}]" if covariate.unit else covariate.name)
    axes.set_ylabel(f"{extent.title} [{extent.unit}]")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False)


def _groups(atlas: Atlas) -> list[tuple[str, dict[str, float]]]:
    """Whom to draw apart: the levels of the first binary covariate, each with its value; else everybody."""
    binary = [covariate for covariate in atlas.covariates if covariate.kind == "binary"]
    if not binary:
        return [("", {})]
    first = binary[0]
    return [(level, {first.name: side}) for level, side in zip(first.levels, (-1.0, 1.0), strict=True)]


def _usual_along(
    cohort: Cohort, covariate: Covariate, fixed: Values
) -> tuple[NDArray[np.float64], ...] | None:
    """Places, the median of people there, and both ends of what 95 % of them have."""
    norms, atlas = cohort.norms, cohort.atlas
    if norms is None or VOLUME.name not in norms.spreads:
        return None
    places = np.linspace(*covariate.range, PLACES)
    path = growth_path(atlas.population, covariate.name, places)
    way = [{**dict(zip(atlas.population.names, values, strict=True)), **fixed} for values in path.tolist()]
    try:
        shapes = shapes_along(atlas, norms.gauge.coarse, way)
    except InputError:  # the template folds on the way
        return None
    expected = norms.gauge.curve(VOLUME, shapes)
    spread = norms.spreads[VOLUME.name]
    return places, expected * np.exp(spread.centre), *spread.band(expected)


def _unusual(cohort: Cohort) -> tuple[list[str], list[list[str]]]:
    scores = unusualness(cohort)
    order = np.argsort(-scores, kind="stable")[:SHOWN]
    extent, frame = cohort.atlas.extent, cohort.atlas.frame
    head = ["row", "subject", "visit", "covariates", extent.title, "percentile", "residual", "remarks"]
    rows = []
    for index in order:
        one = cohort.fitted[int(index)]
        record, percentile = one.record, one.record["measures"].get(extent.title, {}).get("percentile")
        shown = "" if percentile is None else f"{percentile:.1f}"
        away = frame.length(record[cohort.residual], 2)
        told = [
            _covariates(record, cohort.atlas.covariates),
            extent.told(record[extent.key()], 2),
            shown,
            away,
        ]
        rows.append([*_about(one), *told, "; ".join(one.remarks)])
    return head, rows


def _covariates(record: Any, covariates: Sequence[Covariate]) -> str:
    words = []
    for covariate in covariates:
        ends = record["intervals"].get(covariate.name)
        interval = "" if ends is None else f" ({interval_in_words(covariate, *ends)})"
        words.append(f"{covariate.name} {covariate.format(record['covariates'][covariate.name])}{interval}")
    return ", ".join(words)


def _rejected(cohort: Cohort) -> tuple[list[str], list[list[str]]]:
    chosen = cohort.rejected[:SHOWN]
    return ["row", "subject", "visit", "reason"], [[*_about(one), one.reason] for one in chosen]


def _about(one: Outcome) -> list[str]:
    return [str(one.row.number), one.row.subject, one.row.visit]


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [f"<tr>{''.join(f'<th>{escape(name)}</th>' for name in head)}</tr>"]
    lines += [f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows]
    return f"<table>{''.join(lines)}</table>"
