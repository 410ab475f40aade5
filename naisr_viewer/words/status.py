"""The line at the bottom left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from naisr_viewer.state.requests import EXACT_RESOLUTION, Origin, SurfaceResult
from naisr_viewer.words.numbers import duration, length


@dataclass(frozen=True)
class Situation:
    """What the line tells.

    Attributes:
        views: how many sub-plots there shall be; none without an atlas.
        results: what is shown in them.
        late: how many of them show earlier values, or nothing yet.
        is_busy: whether anything is being computed.
        is_refining: whether exact surfaces are.
        halted: why nothing is computed any more; empty where nothing halted it.
        notice: what else there is to tell, for example of a file that was written.
    """

    views: int
    results: Sequence[SurfaceResult]
    late: int
    is_busy: bool
    is_refining: bool
    halted: str
    notice: str


def status_line(now: Situation) -> str:
    """What is on screen and what is being done about it."""
    if not now.results:
        return now.halted or ("Opening …" if now.is_busy else "No atlas open")
    exact = [result for result in now.results if result.is_exact]
    coarse = [result for result in now.results if not result.is_exact]
    behind = f"{now.late} of {now.views} views"
    if now.late and now.halted:
        return f"{now.halted} · {behind} show earlier values"
    if now.late and not coarse:
        return f"Updating {behind} …"
    text = _in_short(coarse or exact)
    if now.is_refining:
        goal = _lattice(EXACT_RESOLUTION, now.results[0])
        text += f" · refining to {goal}, {len(exact)} of {len(now.results)} views done"
    return " · ".join(filter(None, (text, now.halted, now.notice)))


def _in_short(results: Sequence[SurfaceResult]) -> str:
    """What these surfaces are, how long they took, and how far off their previews were."""
    seconds = sum({id(result.points_mm): result.seconds for result in results}.values())
    if results[0].origin is Origin.TABLES:
        return f"Preview in {1000 * seconds:.0f} ms"
    size = _lattice(results[0].request.resolution, results[0])
    text = f"{'Exact' if results[0].is_exact else 'Preview'} {size} in {duration(seconds)}"
    errors = [result.preview_error_mm for result in results if result.preview_error_mm is not None]
    return f"{text} · 99 % of the preview was within {length(max(0.01, *errors))}" if errors else text


def _lattice(resolution: int, result: SurfaceResult) -> str:
    """How fine it is: ``128³``, in the plane ``128²``."""
    return f"{resolution}{'²' if result.dim == 2 else '³'}"
