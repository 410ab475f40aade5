"""A patient's scan, with its distance to the full shape."""

import numpy as np

from naisr_viewer.panels.base import PanelKind, ask_full_shape
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.layouts import Layout
from naisr_viewer.state.requests import SurfaceResult
from naisr_viewer.words.captions import Caption, beyond, large
from naisr_viewer.words.numbers import length
from naisr_viewer.words.patients import size_of

HINT = (
    "Distance of the scan to the full shape along its normal, in mm, to first order: "
    "positive where the scan lies outside the shape. The residual is its mean without the sign, over points "
    "of the whole scan that the fit has not seen."
)
WORTH_TELLING = 0.01
UNEXPRESSED = (
    "So much of the scan lies farther from the fitted shape than its uncertainty allows: the atlas has no "
    "such shape, whatever the code. Look at the places in strong colours: a finding, or a fault of the scan."
)


def _caption(state: ExplorerState, result: SurfaceResult) -> Caption:
    assert state.atlas is not None
    scan = state.shown.scan if state.shown else None
    text = large(size_of(scan, state.atlas) if scan else "…") + _away(state, result)
    share = result.unexpressed
    if share is None or share < WORTH_TELLING:
        return Caption(text, HINT)
    return Caption(f"{text}<br>{100 * share:.0f}\u00a0% cannot be expressed", f"{HINT}\n{UNEXPRESSED}")


def _away(state: ExplorerState, result: SurfaceResult) -> str:
    """The residual of the fit; at other covariates, where it no longer counts, the mean of the colours."""
    if result.colouring is None or state.atlas is None:
        return ""
    unit = state.atlas.frame.unit
    if state.fit is not None and result.request.values == state.fit.values:
        told = f"residual {length(state.fit.residual_mm, unit)}"
    else:
        told = f"{length(float(np.abs(result.colouring.values).mean()), unit)} from this shape on average"
    return f"<br>{told}{beyond(result.colouring)}"


KIND = PanelKind(
    name="scan",
    title="Scan",
    hint=(
        "The patient's scan, coloured by its distance to the full shape in mm:\n"
        "orange where the scan lies outside the shape (+), blue where it lies inside (−)."
    ),
    layouts=frozenset({Layout.FIT}),
    ask=ask_full_shape,
    caption=_caption,
    colour="#b9b2a6",
    scale="signed",
    quantity="distance",
    is_modelled=False,
)
