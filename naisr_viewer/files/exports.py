"""Which files an export writes: named after what they hold, so that no two of them meet."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from itertools import count
from pathlib import Path
from typing import NamedTuple

from naisr_model.covariates import Covariate
from naisr_viewer.files.surfaces import record_of
from naisr_viewer.panels.kinds import kind_of, request_for, title_of
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.layouts import Panel
from naisr_viewer.state.matrix import plain_panel
from naisr_viewer.state.patients import Named, OpenScan
from naisr_viewer.state.requests import EXACT_RESOLUTION, ExportChoice, SurfaceRequest

STRANGE = re.compile(r"[^\w.+-]+")
"""What a file system, a shell or a web address may take for something else."""

LONGEST_STEM = 180
"""Bytes of a name without its ending; file systems take 255 with it."""


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
    words = "-".join([atlas.name, *_plain_names(owner), title_of(view)]).lower()
    parts = [words, *_values(atlas, request.values)]
    if request.before is not None:
        parts += ["-".join(["since", *_since(request.before[0], owner, reference)])]
        parts += _values(atlas, request.before[1])
    return _short("_".join(STRANGE.sub("-", part).strip("-") for part in parts))


def matrix_stem(state: ExplorerState) -> str:
    """The same for all files of the matrix together: ``airway-p01-matrix_age_weight``."""
    assert state.atlas is not None
    assert state.matrix is not None
    owner = state.shown if state.fit else None
    words = "-".join([state.atlas.name, *_plain_names(owner), "matrix"]).lower()
    parts = [words, state.matrix.across.covariate, state.matrix.down.covariate]
    return _short("_".join(STRANGE.sub("-", part).strip("-") for part in parts))


def _since(person: int, owner: OpenScan | None, reference: OpenScan | None) -> list[str]:
    """Whom a change is counted from, where that is not its owner."""
    if not person:
        return ["average"]
    return _plain_names(reference if reference is not owner else None)


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


def _short(stem: str) -> str:
    """``stem``, where it is too long for a file system cut and marked so that two of them stay apart."""
    if len(stem.encode()) <= LONGEST_STEM:
        return stem
    mark = hashlib.sha256(stem.encode()).hexdigest()[:8]
    return f"{stem.encode()[:LONGEST_STEM].decode(errors='ignore')}-{mark}"


def _values(atlas: AtlasCard, values: Named) -> list[str]:
    known = {covariate.name: covariate for covariate in atlas.covariates}
    return [_value(known[name], value) for name, value in values]


def _value(covariate: Covariate, value: float) -> str:
    """``age120``, ``weight34.5``, ``sexM``; of a level in between its number."""
    told = covariate.format(value) if covariate.kind == "binary" and abs(value) == 1 else f"{value:.4g}"
    return f"{covariate.name}{told}"


def _plain_names(owner: OpenScan | None) -> list[str]:
    """The name without the file's ending and without parentheses: ``p01.stl (2)`` is ``p01 2``."""
    if owner is None:
        return []
    file = owner.reading.path.name
    stem = file.removesuffix(".gz").rpartition(".")[0] or file
    return [owner.name.replace(file, stem).replace("(", "").replace(")", "")]
