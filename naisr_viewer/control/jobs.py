"""What the workers are given to do; every job is made with all it needs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from threading import Event

from naisr_model.errors import InputError
from naisr_model.exports import CURVE_FORMATS
from naisr_model.files import write_all
from naisr_model.progress import Progress
from naisr_viewer.control.worker import Deliver, Job
from naisr_viewer.engine.atlases import Read
from naisr_viewer.engine.clinic import Clinic
from naisr_viewer.engine.curves import curves, standings
from naisr_viewer.engine.engine import POLL_S, Engine
from naisr_viewer.engine.ledgers import ledger, origin_mm
from naisr_viewer.engine.sessions import Restored, completed, restored
from naisr_viewer.files.exports import Planned
from naisr_viewer.files.figure import figure_bytes
from naisr_viewer.files.matrix import MatrixPlan, figure_of, write_matrix
from naisr_viewer.files.sessions import write_session
from naisr_viewer.files.surfaces import surface_files
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.curves import CurveRequest, Curves, Standing
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.layouts import Panel
from naisr_viewer.state.patients import Fitted, Labels, Named, OpenScan, Reading, Scan, Stated
from naisr_viewer.state.pins import Ledger, LedgerRequest, Point
from naisr_viewer.state.requests import ExportChoice, SurfaceRequest, SurfaceResult
from naisr_viewer.state.session import Session

COMPUTING = 0.7
"""Of the time that a figure takes."""

AT_ONCE = 6
"""Previews that are waited for before any is painted."""

Surfaces = tuple[SurfaceResult, ...]


@dataclass(frozen=True)
class ExportReport:
    """An export that came to its end."""

    count: int
    choice: ExportChoice

    @property
    def sentence(self) -> str:
        """What the status line says."""
        what = "curve" if self.choice.format in CURVE_FORMATS else "surface"
        surfaces = f"1 {what}" if self.count == 1 else f"{self.count} {what}s"
        surfaces = f"a figure and {surfaces}" if self.choice.figure else surfaces
        return f"Exported {surfaces} as {self.choice.format.upper()} to {self.choice.folder}"


def reading_atlas(engine: Engine, path: Path) -> Job[Read]:
    """Reads an atlas; hands it over, still to be opened."""
    return lambda deliver, _progress: deliver(engine.read(path))


def frame(engine: Engine, requests: Sequence[SurfaceRequest]) -> Job[Surfaces]:
    """All surfaces of one moment, handed over together so that they are painted together; many in groups."""

    def job(deliver: Deliver[Surfaces], progress: Progress) -> None:
        for start in range(0, len(requests), AT_ONCE):
            progress.check()
            group = requests[start : start + AT_ONCE]
            deliver(tuple(engine.surface(request, progress.quiet) for request in group))

    return job


def one_by_one(engine: Engine, requests: Sequence[SurfaceRequest]) -> Job[Surfaces]:
    """Surfaces that are handed over one by one, because each takes a while."""

    def job(deliver: Deliver[Surfaces], progress: Progress) -> None:
        for request, piece in progress.over(requests):
            deliver((engine.surface(request, piece),))

    return job


def exporting(
    engine: Engine, atlas: AtlasCard, plan: Sequence[Planned], choice: ExportChoice
) -> Job[ExportReport]:
    """Writes the surfaces of a plan, all or none; hands over a report on what was chosen."""

    def job(deliver: Deliver[ExportReport], progress: Progress) -> None:
        surfaces = [engine.surface(each.request, piece) for each, piece in progress.over(plan)]
        pairs = zip(plan, surfaces, strict=True)
        files = (surface_files(each.path, found, atlas, each.owner, each.reference) for each, found in pairs)
        write_all(chain.from_iterable(files))
        deliver(ExportReport(len(plan), choice))

    return job


def exporting_matrix(
    engine: Engine, state: ExplorerState, plan: MatrixPlan, choice: ExportChoice, colours: Mapping[Panel, str]
) -> Job[ExportReport]:
    """Writes the matrix, all files or none; hands over a report on what was chosen."""

    def job(deliver: Deliver[ExportReport], progress: Progress) -> None:
        computing = progress.part(0.0, COMPUTING).over(plan.cells)
        surfaces = [engine.surface(each.request, piece) for each, piece in computing]
        drawing = progress.part(COMPUTING, 1.0)
        figure = figure_bytes(figure_of(state, choice, surfaces, colours), choice.figure, drawing)
        progress.check()
        write_matrix(plan, state, surfaces, figure)
        deliver(ExportReport(len(plan.cells), choice))

    return job


def preparing(engine: Engine, path: Path, person: int) -> Job[None]:
    """Makes previews of a person fast; hands over nothing."""
    return lambda _deliver, progress: engine.prepare_previews(path, person, progress)


def reading(clinic: Clinic, atlas: Path, wanted: Reading, known: Named) -> Job[Scan | Labels]:
    """Reads a patient's file; hands over the scan, or the labels that are to be chosen from first."""
    return lambda deliver, progress: deliver(
        clinic.labels(atlas, wanted) or clinic.read(atlas, wanted, known, progress)
    )


def fitting(clinic: Clinic, atlas: Path, scan: Scan, known: Named) -> Job[tuple[Fitted, Scan]]:
    """Fits an open atlas to a scan; hands over what was found, and the scan as it lay for it."""
    return lambda deliver, progress: deliver(clinic.fit(atlas, scan, known, progress))


Outcome = tuple[OpenScan, Named, tuple[Fitted, Scan] | InputError]
"""Who was to be fitted, with what is known of them, and what came of it."""


def fitting_all(clinic: Clinic, atlas: Path, patients: Sequence[tuple[OpenScan, Named]]) -> Job[Outcome]:
    """Fits an open atlas to scans one by one; hands over each as it is found, or why it was not."""

    def job(deliver: Deliver[Outcome], progress: Progress) -> None:
        for (patient, known), piece in progress.over(patients):
            try:
                deliver((patient, known, clinic.fit(atlas, patient.scan, known, piece)))
            except InputError as error:
                deliver((patient, known, error))

    return job


def reading_table(clinic: Clinic, atlas: Path, table: Path) -> Job[tuple[Stated, ...]]:
    """Reads what a table says of scans; hands it over."""
    return lambda deliver, _progress: deliver(clinic.stated(atlas, table))


def saving(engine: Engine, session: Session, persons: Sequence[int], path: Path) -> Job[Path]:
    """Writes a session, of whose patients these are the persons; hands over where it is."""

    def job(deliver: Deliver[Path], _progress: Progress) -> None:
        write_session(completed(engine, session, persons), path)
        deliver(path)

    return job


def restoring(engine: Engine, clinic: Clinic, session: Session) -> Job[Restored]:
    """Opens what a session had open; hands it over."""
    return lambda deliver, progress: deliver(restored(engine, clinic, session, progress))


def pinning(engine: Engine, surface: SurfaceRequest, point_mm: Point) -> Job[Point]:
    """Finds the material point at a point of a surface; hands over where that is on the template."""
    return lambda deliver, _progress: deliver(origin_mm(engine, surface, point_mm))


def telling(engine: Engine, request: LedgerRequest) -> Job[Ledger]:
    """Finds the pinned places and what moved them."""
    return lambda deliver, _progress: deliver(ledger(engine, request))


def measuring(engine: Engine, request: CurveRequest) -> Job[Curves]:
    """Measures along a covariate."""
    return lambda deliver, progress: deliver(curves(engine, request, progress))


def reckoning(engine: Engine, path: Path, at_rest: Event) -> Job[bool]:
    """Finds what is usual among the people of an atlas, unless a hand moves; hands over that it did."""

    def job(deliver: Deliver[bool], progress: Progress) -> None:
        def is_unwanted() -> bool:
            while not (progress.is_unwanted() or at_rest.wait(POLL_S)):
                pass
            return progress.is_unwanted()

        engine.norms(path, replace(progress, is_unwanted=is_unwanted))
        deliver(True)

    return job


def standing(engine: Engine, path: Path, person: int) -> Job[tuple[Standing, ...]]:
    """Finds where a patient stands among people."""
    return lambda deliver, progress: deliver(standings(engine, path, person, progress))
