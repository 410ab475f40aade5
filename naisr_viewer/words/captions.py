"""The line beneath each sub-plot, and hints on what it and its sub-plot mean."""

from __future__ import annotations

import numpy as np

from naisr_viewer.state.explorer import ExplorerState, is_seen
from naisr_viewer.state.requests import Colouring, SurfaceResult
from naisr_viewer.words.numbers import gained, volume

PANEL_HINTS = {
    "template": "The shape from which all others are made.",
    "effect": (
        "The template moved by this covariate alone, all others at the population mean.\n"
        "Displacements add up at a point; the surfaces shown here do not add up to the full shape."
    ),
    "shape": "The template moved by all covariates together.",
    "scan": (
        "The patient's scan, coloured by its distance to the full shape in mm:\n"
        "orange where the scan lies outside the shape (+), blue where it lies inside (−)."
    ),
    "certainty": (
        "The full shape, coloured by how far its surface may lie off in mm:\n"
        "half of the 95 % interval of its place, inwards or outwards."
    ),
    "before": "The shape that changes are counted from.",
    "change": (
        "The full shape, coloured by how far it has moved since “before” in mm:\n"
        "orange where it moved outwards (+), blue where it moved inwards (−)."
    ),
}
"""What each kind of sub-plot is."""

DOUBTFUL, DOUBTFUL_CHANGE = "preview uncertain", "correspondence uncertain"
DOUBTFUL_HINT = (
    "The deformation folds here, so the preview may lack or invent pieces; the exact surface follows at rest."
)
DOUBTFUL_CHANGE_HINT = (
    "The deformation folds here, so which point of the earlier surface belongs to one of the later is unsure."
)
UNSEEN = "outside the data"
UNSEEN_HINT = (
    "Hardly anyone behind the atlas is near this combination of covariates (those not moved here are at "
    "their mean), so the shape is a guess."
)
DISTANCE_HINT = (
    "Distance of the scan to the full shape along its normal, in mm, to first order: "
    "positive where the scan lies outside the shape."
)
CERTAINTY_HINT = (
    "Half of the 95 % interval of the surface's place along its normal, in mm, for someone known by one "
    "scan; the interval of the volume stands under the full shape."
)
CHANGE_HINT = (
    "How far the surface has moved along its normal since “before”, in mm, point by point: "
    "positive where it has moved outwards."
)

LATER = (
    "\nAway from the patient's own covariates another day is meant: what sets the patient apart is kept only "
    "as far as it is expected to last."
)

WORTH_TELLING = 0.05
"""Share of a surface beyond its colour scale from which on that is said."""


def caption(state: ExplorerState, result: SurfaceResult) -> tuple[str, str]:
    """Rich text for beneath a surface, and a hint for who hovers over it."""
    assert state.atlas is not None
    if result.request.panel.kind == "scan":
        return _large(_scan_volume(state)) + _mean_distance(result), DISTANCE_HINT
    if len(result.faces) == 0:
        return "no surface at these values", "The signed distance is nowhere zero inside the box."
    text, hint = _measured(result)
    if result.doubtful:
        if result.request.panel.kind == "change":
            return f"{text}<br>{DOUBTFUL_CHANGE}", DOUBTFUL_CHANGE_HINT
        return f"{text}<br>{DOUBTFUL}", DOUBTFUL_HINT
    if is_seen(state.atlas.population, dict(result.request.values)):
        return text, hint
    return f"{text}<br>{UNSEEN}", UNSEEN_HINT


def _measured(result: SurfaceResult) -> tuple[str, str]:
    if result.request.panel.kind == "certainty":
        return _mean_margin(result), CERTAINTY_HINT
    if result.request.panel.kind == "change":
        return _change(result), CHANGE_HINT + LATER
    within = "" if result.volume_margin_cm3 is None else f", ± half of its 95 % interval.{LATER}"
    return _large(volume(result.volume_cm3, result.volume_margin_cm3)), f"Enclosed volume{within}"


def _scan_volume(state: ExplorerState) -> str:
    scan = state.shown.scan if state.shown else None
    return "open surface" if scan is None or scan.volume_cm3 is None else volume(scan.volume_cm3)


def _mean_distance(result: SurfaceResult) -> str:
    if result.colouring is None:
        return ""
    mean_mm = np.abs(result.colouring.values_mm).mean()
    return f"<br>mean distance {mean_mm:.2f} mm{_beyond(result.colouring)}"


def _mean_margin(result: SurfaceResult) -> str:
    if result.colouring is None:
        return _large("…")
    mean_mm = result.colouring.values_mm.mean()
    return _large(f"± {mean_mm:.2f} mm") + f"<br>mean 95 % margin{_beyond(result.colouring)}"


def _change(result: SurfaceResult) -> str:
    if result.volume_before_cm3 is None or result.colouring is None:
        return _large("…")
    text = gained(result.volume_cm3, result.volume_before_cm3, result.volume_margin_cm3)
    beyond = _beyond(result.colouring).removeprefix(" · ")
    return _large(text) + (f"<br>{beyond}" if beyond else "")


def _beyond(colouring: Colouring) -> str:
    """A colour at the end of its scale says less than it seems to."""
    share = float((np.abs(colouring.values_mm) > colouring.limit_mm).mean())
    return f" · {100 * share:.0f} % beyond the scale" if share > WORTH_TELLING else ""


def _large(text: str) -> str:
    return f'<span style="font-size:12pt">{text}</span>'
