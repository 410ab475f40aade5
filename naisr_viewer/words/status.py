"""The line at the bottom left. Knows no Qt."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from naisr_viewer.state.explorer import ExplorerState, Panel, visible_panels
from naisr_viewer.state.requests import EXACT_RESOLUTION, Origin, SurfaceResult, missing


def status_line(
    state: ExplorerState,
    shown: Mapping[Panel, SurfaceResult],
    *,
    is_busy: bool,
    is_refining: bool,
    halted: str,
    notice: str,
) -> str:
    """What is on screen and what is being done about it.

    Args:
        state: what shall be on screen.
        shown: what has been shown of each panel.
        is_busy: whether anything is being computed.
        is_refining: whether exact surfaces are.
        halted: why nothing is computed any more; empty where nothing halted it.
        notice: what else there is to tell, for example of a file that was written.
    """
    panels = visible_panels(state)
    results = [shown[panel] for panel in panels if panel in shown]
    if state.atlas is None or not results:
        return halted or ("Opening …" if is_busy else "No atlas open")
    exact = [result for result in results if result.is_exact]
    coarse = [result for result in results if not result.is_exact]
    late = len(missing(state, shown, 0))
    behind = f"{late} of {len(panels)} views"
    if late and halted:
        return f"{halted} · {behind} show earlier values"
    if late and not coarse:
        return f"Updating {behind} …"
    text = _in_short(coarse or exact)
    if is_refining:
        text += f" · refining to {EXACT_RESOLUTION}³, {len(exact)} of {len(results)} views done"
    return " · ".join(filter(None, (text, halted, notice)))


def _in_short(results: Sequence[SurfaceResult]) -> str:
    """What these surfaces are, how long they took, and how far off their previews were."""
    seconds = sum({id(result.points_mm): result.seconds for result in results}.values())
    if results[0].origin is Origin.TABLES:
        return f"Preview in {1000 * seconds:.0f} ms"
    size = results[0].request.resolution
    text = f"{'Exact' if results[0].is_exact else 'Preview'} {size}³ in {seconds:.2g} s"
    errors = [result.preview_error_mm for result in results if result.preview_error_mm is not None]
    return f"{text} · 99 % of the preview was within {max(0.01, *errors):.2f} mm" if errors else text
