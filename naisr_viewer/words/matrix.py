"""What stands at the ends of the columns and rows of the matrix."""

from __future__ import annotations

from dataclasses import dataclass

from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.matrix import Matrix, Side
from naisr_viewer.words.numbers import reading
from naisr_viewer.words.titles import label


@dataclass(frozen=True)
class Heads:
    """Words at the ends.

    Attributes:
        across: above each column, the axis first.
        down: beside each row.
    """

    across: tuple[str, ...]
    down: tuple[str, ...]


def heads(atlas: AtlasCard, matrix: Matrix) -> Heads:
    """The values, and of an axis the one covariate that it is about."""
    return Heads(_ends(atlas, matrix.across, matrix.down), _ends(atlas, matrix.down, matrix.across))


def note(state: ExplorerState) -> str:
    """Of whom the cells are, and where the covariates are that do not change from cell to cell."""
    assert state.atlas is not None
    assert state.matrix is not None
    whose = state.shown.name if state.shown and state.fit else "population average"
    sides = (state.matrix.across.covariate, state.matrix.down.covariate)
    rest = [
        f"{label(covariate.name)}: {reading(covariate, value)}"
        for covariate, value in zip(state.atlas.covariates, state.values, strict=True)
        if covariate.name not in sides
    ]
    return " · ".join([f"{label(state.atlas.name)} atlas, {whose}", *rest])


def _ends(atlas: AtlasCard, side: Side, other: Side) -> tuple[str, ...]:
    covariate = atlas.covariates[atlas.index(side.covariate)]
    return (f"{label(other.covariate)} only", *(reading(covariate, value) for value in side.values))
