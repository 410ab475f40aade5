"""Curves to files, with a record of what they are beside each."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from naisr_model.covariates import Covariate
from naisr_model.errors import InputError
from naisr_model.files import write_all
from naisr_viewer import __version__
from naisr_viewer.files.surfaces import patient_record, record_of
from naisr_viewer.state.curves import DISTANCE, Curves, MeasureCurve, Numbers
from naisr_viewer.state.explorer import ExplorerState

TABLE, PICTURE = ".csv", ".svg"
"""Endings."""

SERIES = {
    "population": "the population's shape, the other covariates as they are",
    "population, how sure": "the same, with where it is with a probability of 95 %",
    "growth path": "the same, the other continuous covariates growing along as in the population",
    "patient": "the patient at other covariates: another day is meant",
    "patient as seen": "the patient at the covariates of the fit, with its 95 % interval",
    "training": "the shapes behind the atlas as it reconstructs them, each at its own covariates",
}
"""Of a table; low and high of the population are what 95 % of people have."""

Row = tuple[str, float, float, float | None, float | None]
"""Series, value of the covariate, the measure, and both ends of 95 % where they are known."""


def write_curve(path: Path, curves: Curves, state: ExplorerState, draw: Callable[[], bytes]) -> None:
    """Write the curve that is chosen in ``state``, and a JSON record beside it.

    Args:
        path: ending in ``.csv`` or ``.svg``.
        curves: the answer that is shown.
        state: the situation.
        draw: the picture of it, as SVG.

    Raises:
        InputError: for another ending, and when a file cannot be written.
    """
    if path.suffix.lower() not in (TABLE, PICTURE):
        raise InputError(f"cannot write '{path.name}'; the ending must be {TABLE} or {PICTURE}")
    curve, covariate = curves.find(state.curve.measure), _covariate(curves, state)
    is_table = path.suffix.lower() == TABLE
    content = table(curves, curve, covariate).encode() if is_table else draw()
    record = json.dumps(description(path, curves, state), indent=2, ensure_ascii=False) + "\n"
    write_all([(path, content), (record_of(path), record.encode())])


def in_the_way(path: Path) -> list[Path]:
    """Files that would be replaced."""
    return [file for file in (path, record_of(path)) if file.exists()]


def table(curves: Curves, curve: MeasureCurve, covariate: Covariate) -> str:
    """A curve as CSV: one row a place of each series."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    along = f"{covariate.name} [{covariate.unit}]" if covariate.unit else covariate.name
    unit = f"[{curve.unit}]"
    writer.writerow(("series", along, f"{curve.name} {unit}", f"low {unit}", f"high {unit}"))
    for series, *numbers in _rows(curves, curve):
        writer.writerow((series, *("" if number is None else f"{number:.6g}" for number in numbers)))
    return text.getvalue()


def description(path: Path, curves: Curves, state: ExplorerState) -> dict[str, Any]:
    """What a file of a curve shows, as plain JSON."""
    atlas, request, curve = state.atlas, curves.request, curves.find(state.curve.measure)
    assert atlas is not None
    whom = next((each for each in state.patients if each.fit and each.fit.person == request.person), None)
    return {
        "file": path.name,
        "atlas": atlas.name,
        "atlas_file": atlas.path.name,
        "program": __version__,
        "measure": curve.name,
        "unit": curve.unit,
        "definition": curve.definition,
        "along": request.covariate,
        "other_covariates": dict(request.others),
        "places_mm": [list(pin.origin_mm) for pin in request.pins] if curve.name == DISTANCE else None,
        "has_band": curve.band is not None,
        "series": SERIES,
        "patient": None if whom is None else patient_record(whom),
    }


def _covariate(curves: Curves, state: ExplorerState) -> Covariate:
    assert state.atlas is not None
    return state.atlas.covariates[state.atlas.index(curves.request.covariate)]


def _rows(curves: Curves, curve: MeasureCurve) -> Iterable[Row]:
    ends = [(None, None)] * len(curves.places) if curve.band is None else zip(*curve.band, strict=True)
    for place, value, (low, high) in zip(curves.places, curve.usual, ends, strict=True):
        yield "population", place, value, low, high
    if curve.sure is not None:
        for place, value, low, high in zip(curves.places, curve.usual, *curve.sure, strict=True):
            yield "population, how sure", place, value, low, high
    for series, values in (("growth path", curve.path), ("patient", curve.own)):
        yield from _plain(series, curves.places, values)
    if (seen := curve.sighting) is not None:
        margin = seen.margin
        sure = (None, None) if margin is None else (seen.value - margin, seen.value + margin)
        yield "patient as seen", seen.place, seen.value, *sure
    yield from _plain("training", curves.visits, curve.observed)


def _plain(series: str, places: Numbers, values: Numbers | None) -> Iterable[Row]:
    """A series without intervals; none where it is not known."""
    if values is not None:
        yield from ((series, place, value, None, None) for place, value in zip(places, values, strict=True))
