"""Which files an export writes: named after what they hold, so that no two of them meet."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from naisr_model.covariates import Covariate
from naisr_viewer.files.surfaces import record_of
from naisr_viewer.panels.kinds import request_for, title_of
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.patients import OpenScan
from naisr_viewer.state.requests import ExportChoice, SurfaceRequest

STRANGE = re.compile(r"[^\w.+-]+")
"""What a file system, a shell or a web address may take for something else."""


class Planned(NamedTuple):
    """One surface of an export.

    Attributes:
        request: which one.
        path: where it goes.
        owner: the patient whose it is; None for the population average.
    """

    request: SurfaceRequest
    path: Path
    owner: OpenScan | None


def planned(state: ExplorerState, choice: ExportChoice) -> list[Planned]:
    """What is written for ``choice`` at the values of ``state``; there is an atlas."""
    assert state.atlas is not None
    plan = []
    for panel in choice.panels:
        request = request_for(state, panel, choice.resolution)
        owner = state.shown if request.person else None
        stem = file_stem(state.atlas, request, owner)
        plan.append(Planned(request, choice.folder / f"{stem}.{choice.format}", owner))
    return plan


def in_the_way(plan: Sequence[Planned]) -> list[Path]:
    """Files that an export would replace."""
    files = [file for each in plan for file in (each.path, record_of(each.path))]
    return [file for file in files if file.exists()]


def file_stem(atlas: AtlasCard, request: SurfaceRequest, owner: OpenScan | None = None) -> str:
    """A telling name without an ending: ``airway-age-only_age120``, ``airway-p01-full-shape_age120_sexM``."""
    person = [] if owner is None else [_plain_name(owner)]
    words = "-".join([atlas.name, *person, title_of(request.panel)]).lower()
    known = {covariate.name: covariate for covariate in atlas.covariates}
    values = [_value(known[name], value) for name, value in request.values]
    return "_".join(STRANGE.sub("-", part).strip("-") for part in (words, *values))


def _value(covariate: Covariate, value: float) -> str:
    """``age120``, ``weight34.5``, ``sexM``; of a level in between its number."""
    told = covariate.format(value) if covariate.kind == "binary" and abs(value) == 1 else f"{value:.4g}"
    return f"{covariate.name}{told}"


def _plain_name(owner: OpenScan) -> str:
    """The name without the file's ending and without parentheses: ``p01.stl (2)`` is ``p01 2``."""
    file = owner.reading.path.name
    stem = file.removesuffix(".gz").rpartition(".")[0] or file
    return owner.name.replace(file, stem).replace("(", "").replace(")", "")
