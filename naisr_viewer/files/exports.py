"""Which files an export writes: named after what they hold, so that no two of them meet."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count
from pathlib import Path
from typing import NamedTuple

from naisr_viewer.files.surfaces import record_of
from naisr_viewer.panels.kinds import kind_of, request_for, title_of
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.layouts import Panel
from naisr_viewer.state.matrix import plain_panel
from naisr_viewer.state.patients import OpenScan
from naisr_viewer.state.requests import EXACT_RESOLUTION, ExportChoice, SurfaceRequest
from naisr_viewer.words.names import in_names, plain_names, stem_of, what_of


class Planned(NamedTuple):
    """One surface of an export.

    Attributes:
        request: which one.
        path: where it goes.
        owner: the patient whose it is; None for the population average.
        reference: the patient that a change is counted from; None where none is.
    """

    request: SurfaceRequest
    path: Path
    owner: OpenScan | None
    reference: OpenScan | None


def planned(state: ExplorerState, choice: ExportChoice) -> list[Planned]:
    """What is written for ``choice`` at the values of ``state``; there is an atlas."""
    assert state.atlas is not None
    plan: list[Planned] = []
    for panel in choice.panels:
        request = request_for(state, panel, _resolution(panel, choice))
        owner = _patient(state, request.person)
        reference = _patient(state, request.before[0]) if request.before else None
        path = choice.folder / f"{file_stem(state.atlas, request, owner, reference)}.{choice.format}"
        plan.append(Planned(request, _apart(path, plan), owner, reference))
    return plan


def in_the_way(plan: Sequence[Planned]) -> list[Path]:
    """Files that an export would replace."""
    files = [file for each in plan for file in (each.path, record_of(each.path))]
    return [file for file in files if file.exists()]


def file_stem(
    atlas: AtlasCard,
    request: SurfaceRequest,
    owner: OpenScan | None = None,
    reference: OpenScan | None = None,
) -> str:
    """A telling name without an ending: ``airway-age-only_age120``, ``airway-p01-full-shape_age120_sexM``.

    Of a change also what it is counted from: ``airway-p01-change_age120_sexM_since_age84_sexM``, and whom
    where that is somebody else.
    """
    view = plain_panel(request.values) if request.panel.cell else request.panel
    parts = [what_of(atlas, *plain_names(owner), what=title_of(view)), *in_names(atlas, request.values)]
    if request.before is not None:
        parts += ["-".join(["since", *_since(request.before[0], owner, reference)])]
        parts += in_names(atlas, request.before[1])
    return stem_of(*parts)


def matrix_stem(state: ExplorerState) -> str:
    """The same for all files of the matrix together: ``airway-p01-matrix_age_weight``."""
    assert state.atlas is not None
    assert state.matrix is not None
    owner = state.shown if state.fit else None
    first = what_of(state.atlas, *plain_names(owner), what="matrix")
    return stem_of(first, state.matrix.across.covariate, state.matrix.down.covariate)


def _since(person: int, owner: OpenScan | None, reference: OpenScan | None) -> list[str]:
    """Whom a change is counted from, where that is not its owner."""
    if not person:
        return ["average"]
    return plain_names(reference if reference is not owner else None)


def _resolution(panel: Panel, choice: ExportChoice) -> int:
    """Numbers on a surface there are only on exact ones."""
    return max(choice.resolution, EXACT_RESOLUTION) if kind_of(panel).scale else choice.resolution


def _patient(state: ExplorerState, person: int) -> OpenScan | None:
    """Whose code it is; None for the population average."""
    return next((each for each in state.patients if each.fit and each.fit.person == person), None)


def _apart(path: Path, plan: Sequence[Planned]) -> Path:
    """``path``, numbered where another surface of the plan goes there; file systems may not tell case."""
    taken = {each.path.name.lower() for each in plan}
    numbered = (path.with_name(f"{path.stem}-{number}{path.suffix}") for number in count(2))
    return (
        path if path.name.lower() not in taken else next(p for p in numbered if p.name.lower() not in taken)
    )
