"""What a kind of view must say of itself.

A kind is a value in a file of its own, named in :mod:`~naisr_viewer.panels.kinds`; how its request is
answered says the file of the same name under ``engine/answers``.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.layouts import Cell, Layout, Panel
from naisr_viewer.state.overlay import Map
from naisr_viewer.state.patients import Named
from naisr_viewer.state.requests import Scale, SurfaceRequest, SurfaceResult
from naisr_viewer.words.captions import DOUBTFUL, NO_SURFACE, NOT_VALID, UNSEEN, Caption, large
from naisr_viewer.words.numbers import MILLIMETRES, in_unit

Ask = Callable[[ExplorerState, Panel, int], SurfaceRequest]
"""What a panel shows in a state, at so many cells along a side of the box; there is an atlas."""

Measured = Callable[[AtlasCard, SurfaceResult], Caption]
"""What is told of a surface that is there and can be trusted."""


class Numbers(NamedTuple):
    """What is known at each vertex of a surface.

    Attributes:
        name: what they are called in a file, with their unit: ``change_mm``.
        unit: of them.
        meaning: in words.
    """

    name: str
    unit: str
    meaning: str


def numbers(quantity: str, unit: str, meaning: str) -> Numbers:
    """Numbers of a quantity, whose name has the characters that every format allows."""
    return Numbers(re.sub(r"\W+", "_", f"{quantity}_{unit}"), unit, meaning.replace("\n", " "))


@dataclass(frozen=True)
class PanelKind:
    """A kind of view.

    Attributes:
        name: of the kind, in :attr:`~naisr_viewer.state.layouts.Panel.kind`.
        title: what stands above the sub-plot; ``{covariate}`` stands for the panel's covariate.
        hint: what the sub-plot is, for who hovers over its title.
        layouts: where it is on screen; the order is that of the registry.
        ask: the request for it.
        caption: what stands beneath a result.
        colour: of a surface whose vertices have none of their own, ``#rrggbb``; that of the panel's
            covariate when left out.
        scale: of the numbers on its surface; None where it has none.
        unit: of those numbers; millimetres stand for the atlas's unit of length.
        quantity: what they are, in a file; the name of the kind when left out.
        covariates: whose panels there are, one for each name; one of no covariate when left out.
        cells: of the matrix, for each of which there is one.
        is_possible: whether an atlas can show it.
        is_there: whether a state has a place for a panel of this kind.
        away: how far a panel is from what is looked at; what is nearer is computed first.
        is_mapped: whether its surface can be coloured by what covariates do to it.
        is_modelled: whether its surface is the shape model's, in which material points can be found.
    """

    name: str
    title: str
    hint: str
    layouts: frozenset[Layout]
    ask: Ask
    caption: Callable[[ExplorerState, SurfaceResult], Caption]
    colour: str = ""
    scale: Scale | None = None
    unit: str = MILLIMETRES
    quantity: str = ""
    covariates: Callable[[AtlasCard], tuple[str, ...]] = lambda _: ("",)
    cells: tuple[Cell | None, ...] = (None,)
    is_possible: Callable[[AtlasCard], bool] = lambda _: True
    is_there: Callable[[ExplorerState, Panel], bool] = lambda *_: True
    away: Callable[[ExplorerState, Panel], float] = lambda *_: 0.0
    is_mapped: bool = False
    is_modelled: bool = True

    def numbers(self, atlas: AtlasCard) -> Numbers:
        """What those on its surface are by themselves."""
        unit = atlas.frame.unit
        return numbers(self.quantity or self.name, in_unit(self.unit, unit), in_unit(self.hint, unit))

    def panels(self, atlas: AtlasCard) -> tuple[Panel, ...]:
        """All of this kind that an atlas can show."""
        names = self.covariates(atlas) if self.is_possible(atlas) else ()
        return tuple(Panel(self.name, name, cell) for name in names for cell in self.cells)


def ask_full_shape(state: ExplorerState, panel: Panel, resolution: int) -> SurfaceRequest:
    """For what depends on all covariates and on the person who is shown."""
    return asked(state, panel, resolution, state.named, state.person)


def asked(
    state: ExplorerState,
    panel: Panel,
    resolution: int,
    values: Named,
    person: int,
    before: tuple[int, Named] | None = None,
    shown: Map | None = None,
) -> SurfaceRequest:
    """A request to the open atlas, see :class:`~naisr_viewer.state.requests.SurfaceRequest`."""
    assert state.atlas is not None
    return SurfaceRequest(state.atlas.path, panel, values, resolution, person, before, shown)


def caption_of(
    measured: Measured, doubtful: Caption = DOUBTFUL
) -> Callable[[ExplorerState, SurfaceResult], Caption]:
    """A caption that also says whether there is a surface, and whether to believe it.

    Of somebody whose fit is not valid nothing is told that was measured.

    Args:
        measured: of a surface.
        doubtful: said where the deformation folds.
    """

    def caption(state: ExplorerState, result: SurfaceResult) -> Caption:
        assert state.atlas is not None
        if len(result.faces) == 0:
            return NO_SURFACE
        if result.request.person and not state.can_forecast:
            return Caption(large(NOT_VALID.text), NOT_VALID.hint)
        if result.doubtful:
            return doubtful.beneath(measured(state.atlas, result))
        if state.atlas.population.has_data_at(dict(result.request.values)):
            return measured(state.atlas, result)
        return UNSEEN.beneath(measured(state.atlas, result))

    return caption
