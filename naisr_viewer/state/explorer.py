"""What is being explored, as frozen values and pure functions that make the next value."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace

import numpy as np

from naisr_model.covariates import growth_path
from naisr_viewer.state.atlas_card import AtlasCard, RealVector
from naisr_viewer.state.curves import FIRST_CURVE, CurveChoice
from naisr_viewer.state.drawer import Tab, tabs_of
from naisr_viewer.state.layouts import Cell, Layout
from naisr_viewer.state.matrix import Matrix, first_matrix, values_at
from naisr_viewer.state.overlay import NOTHING_SHOWN, Overlay
from naisr_viewer.state.patients import Fitted, Named, OpenScan, Stated
from naisr_viewer.state.pins import Pin, Point, with_pin
from naisr_viewer.state.section import Section
from naisr_viewer.state.support import NOTHING_CHOSEN, Support, suited

AVERAGE_KEY = 0
"""Stands among the keys of patients for the population's average."""


@dataclass(frozen=True)
class ExplorerState:
    """The whole visible situation apart from the camera.

    Attributes:
        atlas: the open atlas, or None before the first one.
        values: real covariate values in the atlas's order.
        layout: which sub-plots are on screen.
        follow: whether the other covariates follow one that is moved, as they do in the population.
        patients: the scans that are open.
        patient: key of the one that is shown; None for the population average.
        compared: key of the one that is compared with; None for the patient as fitted,
            :data:`AVERAGE_KEY` for the population's average at the same covariates.
        has_ghost: whether the scan is drawn over the full shape.
        pins: places that are marked in all shapes, and told of.
        matrix: what shapes are laid out by in that layout; None where there are no two covariates.
        section: the plane that all shapes are cut by; None where they are whole.
        has_edges: whether the triangles of the surfaces are drawn.
        overlay: what the surfaces are coloured by.
        muted: covariates that are left out of the full shape.
        touched: the covariate that was moved last; empty before.
        drawer: the page that is open beneath the shapes; None where it is closed.
        support: over which covariates the data behind the atlas are shown.
        curve: which curve the drawer shows.
        has_norms: whether it is known what is usual among the people of the atlas.
        is_atlas_changed: whether the file of the atlas has changed on the disk since it was read.
    """

    atlas: AtlasCard | None = None
    values: RealVector = ()
    layout: Layout = Layout.SIDE_BY_SIDE
    follow: bool = False
    patients: tuple[OpenScan, ...] = ()
    patient: int | None = None
    compared: int | None = None
    has_ghost: bool = True
    pins: tuple[Pin, ...] = ()
    matrix: Matrix | None = None
    section: Section | None = None
    has_edges: bool = False
    overlay: Overlay = NOTHING_SHOWN
    muted: tuple[str, ...] = ()
    touched: str = ""
    drawer: Tab | None = None
    support: Support = NOTHING_CHOSEN
    curve: CurveChoice = FIRST_CURVE
    has_norms: bool = False
    is_atlas_changed: bool = False

    @property
    def named(self) -> Named:
        """The covariate values with their names."""
        return self.with_names(self.values)

    @property
    def heard(self) -> Named:
        """The same with those that are muted at the population centre, where they move nothing."""
        centre = dict(self.with_names(self.atlas.start)) if self.atlas else {}
        return tuple((name, centre[name] if name in self.muted else value) for name, value in self.named)

    @property
    def shown(self) -> OpenScan | None:
        """The patient that is shown."""
        return self.find(self.patient)

    @property
    def fit(self) -> Fitted | None:
        """The fit of the patient that is shown."""
        return self.shown.fit if self.shown else None

    @property
    def reference(self) -> tuple[int, Named] | None:
        """The person that is compared with, and at which covariates; None where there is no fit."""
        if self.compared == AVERAGE_KEY and self.fit is not None:
            return 0, self.named
        other = self.find(self.compared)
        fit = other.fit if other and other.fit and other.fit.is_valid else self.fit
        return None if fit is None else (fit.person, fit.values)

    @property
    def person(self) -> int:
        """Whose code the surfaces have; 0 for the population average."""
        return self.fit.person if self.fit else 0

    @property
    def home(self) -> RealVector:
        """Where the covariates are reset to: the patient's, or the population mean."""
        if self.fit is not None:
            return tuple(value for _, value in self.fit.values)
        return self.atlas.start if self.atlas else ()

    @property
    def can_forecast(self) -> bool:
        """Whether the patient can be shown at other covariates: a fit that is not valid tells nothing."""
        return self.fit is not None and self.fit.is_valid

    def allows(self, layout: Layout) -> bool:
        """Whether a layout has something to show of the patient that is shown."""
        if layout.is_forecast:
            return self.can_forecast
        return self.fit is not None or not layout.needs_fit

    def find(self, key: int | None) -> OpenScan | None:
        """An open patient; None where there is none with this key."""
        return next((each for each in self.patients if each.key == key), None)

    def with_names(self, values: RealVector) -> Named:
        """RealVector in the atlas's order with their names."""
        names = [covariate.name for covariate in self.atlas.covariates] if self.atlas else []
        return tuple(zip(names, values, strict=True))


def opened(state: ExplorerState, atlas: AtlasCard) -> ExplorerState:
    """``atlas`` at its population mean, without patients."""
    layout = Layout.SIDE_BY_SIDE if state.layout.needs_fit else state.layout
    drawer = state.drawer if state.drawer in tabs_of(atlas) else None
    return ExplorerState(
        atlas,
        atlas.start,
        layout,
        follow=state.follow,
        has_ghost=state.has_ghost,
        has_edges=state.has_edges and not atlas.is_flat,
        matrix=first_matrix(atlas),
        drawer=drawer,
        support=suited(state.support, atlas),
        curve=CurveChoice(state.curve.measure),
    )


def with_value(state: ExplorerState, name: str, value: float) -> ExplorerState:
    """One covariate moved to ``value`` (real units), held inside the observed range."""
    assert state.atlas is not None
    index = state.atlas.index(name)
    low, high = state.atlas.covariates[index].range
    held = min(max(value, low), high)
    return replace(state, values=(*state.values[:index], held, *state.values[index + 1 :]))


def with_values(state: ExplorerState, values: Named) -> ExplorerState:
    """Several covariates moved (real units), each held inside its observed range."""
    for name, value in values:
        state = with_value(state, name, value)
    return state


def followed(state: ExplorerState, name: str, start: RealVector) -> ExplorerState:
    """The other continuous covariates moved along with ``name``, as in the population.

    What each was off the population's path at ``start``, where the movement began, it stays.
    """
    assert state.atlas is not None
    index = state.atlas.index(name)
    path = growth_path(state.atlas.population, name, np.array([start[index], state.values[index]]))
    result = state
    for i, covariate in enumerate(state.atlas.covariates):
        if i != index and covariate.kind == "continuous":
            result = with_value(result, covariate.name, start[i] + float(path[1, i] - path[0, i]))
    return result


def reset(state: ExplorerState, name: str) -> ExplorerState:
    """One covariate back home."""
    assert state.atlas is not None
    return with_value(state, name, state.home[state.atlas.index(name)])


def reset_all(state: ExplorerState) -> ExplorerState:
    """Every covariate back home."""
    return replace(state, values=state.home)


def at_cell(state: ExplorerState, cell: Cell) -> ExplorerState:
    """The covariates of a cell of the matrix."""
    assert state.atlas is not None
    assert state.matrix is not None
    return replace(state, values=values_at(state.atlas, state.matrix, cell, state.values))


def with_patient(state: ExplorerState, patient: OpenScan) -> ExplorerState:
    """A patient opened, or changed where the key is known, and shown."""
    others = [each for each in state.patients if each.key != patient.key]
    patients = tuple(sorted((*others, patient), key=lambda each: each.key))
    return showing(replace(state, patients=patients), patient.key)


def with_changed(state: ExplorerState, patient: OpenScan) -> ExplorerState:
    """A patient changed who is open; the one that is shown stays."""
    patients = tuple(patient if each.key == patient.key else each for each in state.patients)
    return replace(state, patients=patients)


def unfitted(state: ExplorerState) -> tuple[OpenScan, ...]:
    """Who can be fitted and is not, the one that is shown last: it stays on screen until then."""
    chosen = [each for each in state.patients if each.fit is None and not each.scan.blocked]
    return tuple(sorted(chosen, key=lambda each: (each.key == state.patient, each.key)))


def stated_of(patient: OpenScan, stated: Iterable[Stated]) -> tuple[Stated, ...]:
    """What a table says of a patient's file, every row of it once."""
    path = patient.reading.path.resolve()
    return tuple(dict.fromkeys(each for each in stated if each.path.resolve() == path))


def with_stated(state: ExplorerState, stated: Collection[Stated]) -> ExplorerState:
    """What a table says is known of the open scans, where it says one thing; other fits are void then."""
    for patient in state.patients:
        found = [each for each in stated_of(patient, stated) if not each.fault]
        if len(found) == 1 and found[0].known != patient.known:
            state = with_changed(state, replace(patient, known=found[0].known, fit=None))
    return showing(state, state.patient)


def without_patient(state: ExplorerState, key: int) -> ExplorerState:
    """A patient closed; the last of the others is shown."""
    rest = tuple(each for each in state.patients if each.key != key)
    compared = None if state.compared == key else state.compared
    state = replace(state, patients=rest, compared=compared)
    return showing(state, rest[-1].key if rest else None) if state.patient == key else state


def showing(state: ExplorerState, key: int | None) -> ExplorerState:
    """Another patient, at what is known or found of them; None for the population average."""
    state = with_possible_layout(replace(state, patient=key))
    known = state.shown.known if state.shown and not state.fit else ()
    return with_values(replace(state, values=state.home), known)


def with_mute(state: ExplorerState, name: str, is_muted: bool) -> ExplorerState:
    """One covariate left out of the full shape, or taken in again."""
    rest = set(state.muted) - {name}
    return replace(state, muted=tuple(sorted(rest | {name} if is_muted else rest)))


def with_solo(state: ExplorerState, name: str, is_alone: bool) -> ExplorerState:
    """All other covariates left out of the full shape, or all taken in again."""
    others = {other for other, _ in state.named if other != name}
    return replace(state, muted=tuple(sorted(others)) if is_alone else ())


def pinned(state: ExplorerState, origin_mm: Point) -> ExplorerState:
    """One more place pinned, told of beneath the shapes unless something else is open there."""
    return replace(state, pins=with_pin(state.pins, origin_mm), drawer=state.drawer or Tab.POINT)


def without_pin(state: ExplorerState, number: int) -> ExplorerState:
    """One place no longer pinned; with the last of them nothing is told of any."""
    pins = tuple(pin for pin in state.pins if pin.number != number)
    return replace(state, pins=pins) if pins else without_pins(state)


def without_pins(state: ExplorerState) -> ExplorerState:
    """No place pinned, and nothing told of any."""
    return replace(state, pins=(), drawer=None if state.drawer is Tab.POINT else state.drawer)


def knowing_norms(state: ExplorerState) -> ExplorerState:
    """It is known what is usual among the people of the atlas."""
    return replace(state, has_norms=True)


def with_possible_layout(state: ExplorerState) -> ExplorerState:
    """``state`` in a layout that has something to show of the patient."""
    if state.allows(state.layout):
        return state
    return replace(state, layout=Layout.SIDE_BY_SIDE if state.fit is None else Layout.FIT)
