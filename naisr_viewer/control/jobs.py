"""What the worker is given to do with an atlas that is shown; every job is made with all it needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from naisr_viewer.control.worker import Deliver, Job
from naisr_viewer.engine.engine import Engine
from naisr_viewer.files import surfaces
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.requests import ExportChoice, Progress, ShouldStop, SurfaceRequest, request_for


@dataclass(frozen=True)
class ExportReport:
    """An export that came to its end."""

    count: int
    choice: ExportChoice

    @property
    def sentence(self) -> str:
        """What the status line says."""
        surfaces = "1 surface" if self.count == 1 else f"{self.count} surfaces"
        return f"Exported {surfaces} as {self.choice.format.upper()} to {self.choice.folder}"


def opening(engine: Engine, path: Path) -> Job:
    """Reads an atlas; hands over its card."""
    return lambda deliver, _progress, _should_stop: deliver(engine.open(path))


def frame(engine: Engine, requests: Sequence[SurfaceRequest]) -> Job:
    """All surfaces of one moment, handed over together so that they are painted together."""
    return lambda deliver, _progress, should_stop: deliver(
        tuple(engine.surface(request, None, should_stop) for request in requests)
    )


def one_by_one(engine: Engine, requests: Sequence[SurfaceRequest]) -> Job:
    """Surfaces that are handed over one by one, because each takes a while."""

    def job(deliver: Deliver, progress: Progress, should_stop: ShouldStop) -> None:
        for place, request in enumerate(requests):
            deliver((engine.surface(request, _part(progress, place, len(requests)), should_stop),))

    return job


def exporting(engine: Engine, state: ExplorerState, choice: ExportChoice) -> Job:
    """Writes surfaces at the values of ``state``, computing what is missing; hands over a report."""
    atlas = state.atlas
    assert atlas is not None
    requests = [request_for(state, panel, choice.resolution) for panel in choice.panels]

    def job(deliver: Deliver, progress: Progress, should_stop: ShouldStop) -> None:
        for place, request in enumerate(requests):
            owner = state.shown if request.person else None
            result = engine.surface(request, _part(progress, place, len(requests)), should_stop)
            path = choice.folder / f"{surfaces.file_stem(atlas, result, owner)}.{choice.format}"
            surfaces.write_surface(path, result, atlas, owner)
        deliver(ExportReport(len(requests), choice))

    return job


def preparing(engine: Engine, path: Path, person: int) -> Job:
    """Makes previews of a person fast; hands over nothing."""
    return lambda _, progress, should_stop: engine.prepare_previews(path, person, progress, should_stop)


def _part(progress: Progress, place: int, count: int) -> Progress:
    """Progress of one piece as progress of the whole."""
    return lambda fraction: progress((place + fraction) / count)
