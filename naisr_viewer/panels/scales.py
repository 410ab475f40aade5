"""Which colours stand for which numbers on each surface: the scale of its kind, or that of a map on it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from naisr_viewer.panels.kinds import kind_of, request_for, unit_of
from naisr_viewer.panels.maps import numbers_of
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.layouts import Panel
from naisr_viewer.state.requests import Scale, SurfaceResult

DIGITS = 2
"""Of the end of a scale that is fitted to what is shown."""


class PanelScale(NamedTuple):
    """The scale of one surface.

    Attributes:
        scale: from minus to plus its end, or from 0.
        unit: of the numbers.
        key: what the end is kept under; surfaces with the same one share it.
        limit: the end, in that unit; None for the one that the result brings.
    """

    scale: Scale
    unit: str
    key: str
    limit: float | None


def scale_of(state: ExplorerState, panel: Panel) -> PanelScale | None:
    """The scale of a panel; None where its surface is plain."""
    kind, atlas = kind_of(panel), state.atlas
    assert atlas is not None
    shown = request_for(state, panel, 0).map if kind.is_mapped else None
    if kind.scale is None and shown is None:
        return None
    unit = unit_of(panel, atlas) if shown is None else numbers_of(atlas, shown).unit
    own = f"{panel.kind} {panel.covariate}".strip()
    key = own if shown is None or not state.overlay.is_shared else unit
    return PanelScale(kind.scale or "signed", unit, key, dict(state.overlay.limits).get(key))


def fitted_limit(state: ExplorerState, panel: Panel, shown: Mapping[Panel, SurfaceResult]) -> float | None:
    """The end at which the largest number on all surfaces that share a panel's scale is just seen.

    None where there are no numbers, or all are 0.
    """
    scales = {each: scale_of(state, each) for each in shown}
    wanted = scales.get(panel)
    largest = [
        float(np.abs(result.colouring.values).max(initial=0.0))
        for each, result in shown.items()
        if result.colouring is not None and wanted is not None and _key(scales[each]) == wanted.key
    ]
    most = max(largest, default=0.0)
    return rounded_up(most) if most > 0 else None


def rounded_up(number: float) -> float:
    """The next number with two digits: 8.507 is 8.6, 0.0311 is 0.032."""
    step = 10.0 ** (math.floor(math.log10(number)) - DIGITS + 1)
    return float(f"{math.ceil(number / step - 1e-9) * step:.{DIGITS}g}")


def _key(scale: PanelScale | None) -> str:
    return "" if scale is None else scale.key
