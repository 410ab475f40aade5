"""Names of files, telling what is in them."""

from __future__ import annotations

import hashlib
import re

from naisr_model.covariates import Covariate
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.patients import Named, OpenScan

STRANGE = re.compile(r"[^\w.+-]+")
"""What a file system, a shell or a web address may take for something else."""

LONGEST_STEM = 180
"""Bytes of a name without its ending; file systems take 255 with it."""


def stem_of(*parts: str) -> str:
    """A name without an ending: ``airway-p01-full-shape_age120``.

    One that is too long for a file system is cut, and marked so that two of them stay apart.
    """
    stem = "_".join(STRANGE.sub("-", part).strip("-") for part in parts)
    if len(stem.encode()) <= LONGEST_STEM:
        return stem
    mark = hashlib.sha256(stem.encode()).hexdigest()[:8]
    return f"{stem.encode()[:LONGEST_STEM].decode(errors='ignore')}-{mark}"


def what_of(atlas: AtlasCard, *owner: str, what: str = "") -> str:
    """Its first part: of which atlas, whose, and what."""
    return "-".join(filter(None, [atlas.name, *owner, what])).lower()


def seen_stem(state: ExplorerState, what: str = "", has_values: bool = False) -> str:
    """Of what is seen of a situation, whoever's it is: ``airway-p01-session``, ``airway_age120_sexM``."""
    if state.atlas is None:
        return what or "atlas"
    values = in_names(state.atlas, state.named) if has_values else []
    return stem_of(what_of(state.atlas, *plain_names(state.shown), what=what), *values)


def in_names(atlas: AtlasCard, values: Named) -> list[str]:
    """Covariate values: ``age120``, ``weight34.5``, ``sexM``; of a level in between its number."""
    known = {covariate.name: covariate for covariate in atlas.covariates}
    return [_value(known[name], value) for name, value in values]


def plain_names(owner: OpenScan | None) -> list[str]:
    """The name without the file's ending and without parentheses: ``p01.stl (2)`` is ``p01 2``."""
    if owner is None:
        return []
    file = owner.reading.path.name
    stem = file.removesuffix(".gz").rpartition(".")[0] or file
    return [owner.name.replace(file, stem).replace("(", "").replace(")", "")]


def _value(covariate: Covariate, value: float) -> str:
    told = covariate.format(value) if covariate.kind == "binary" and abs(value) == 1 else f"{value:.4g}"
    return f"{covariate.name}{told}"
