"""How far a patient's scan is from another one: another patient's, or another version of the same file."""

from naisr_viewer.panels.base import PanelKind, asked
from naisr_viewer.panels.scan import KIND as SCAN
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.layouts import Layout, Panel
from naisr_viewer.state.requests import SurfaceRequest, SurfaceResult
from naisr_viewer.words.captions import Caption, beyond, large
from naisr_viewer.words.numbers import gained, way

HINT = (
    "Distance of the scan to the other scan, in mm, each as it lies for its fit: positive where this one "
    "lies outside the other. Above it, how much more this scan encloses, where both are closed."
)


def _is_there(state: ExplorerState, _panel: Panel) -> bool:
    """Whether another scan is compared with, and both have a surface."""
    other, shown = state.find(state.compared), state.shown
    if other is None or shown is None or other is shown or not state.can_forecast:
        return False
    is_fitted = other.fit is not None and other.fit.is_valid
    return is_fitted and len(other.scan.faces) > 0 and len(shown.scan.faces) > 0


def _ask(state: ExplorerState, panel: Panel, resolution: int) -> SurfaceRequest:
    before = None if state.reference is None else (state.reference[0], ())
    return asked(state, panel, resolution, (), state.person, before)


def _caption(state: ExplorerState, result: SurfaceResult) -> Caption:
    assert state.atlas is not None
    frame = state.atlas.frame
    before, now = result.extent_before, result.extent
    text = gained(now, before, None, frame.extent) if before and now else "…"
    if result.colouring is None:
        return Caption(large(text), HINT)
    low, high = result.colouring.values.min(), result.colouring.values.max()
    ends = f"{way(float(low), frame.unit)} to {way(float(high), frame.unit)}"
    return Caption(
        large(text if before and now else "open scans") + f"<br>{ends}{beyond(result.colouring)}", HINT
    )


KIND = PanelKind(
    name="scans",
    title="Scan to scan",
    hint=(
        "This patient's scan, coloured by its distance to the scan that is compared with, in mm:\n"
        "orange where it lies outside the other (+), blue where it lies inside (−)."
    ),
    layouts=frozenset({Layout.CHANGE}),
    ask=_ask,
    caption=_caption,
    colour=SCAN.colour,
    scale="signed",
    quantity="difference",
    is_modelled=False,
    is_there=_is_there,
    is_possible=lambda atlas: atlas.capabilities.trackable,  # as the change beside it
)
