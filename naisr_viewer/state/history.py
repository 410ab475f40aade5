"""What was before and after the present work, so that nothing that was done is lost."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from naisr_viewer.state.explorer import ExplorerState, with_possible_layout

UNDO_DEPTH = 50
"""How many acts are remembered; the fits that only they refer to stay in memory."""


@dataclass(frozen=True)
class Step:
    """One act.

    Attributes:
        before: the state it found.
        after: the state it left.
    """

    before: ExplorerState
    after: ExplorerState


@dataclass(frozen=True)
class History:
    """Acts before the present state, and those that were undone, nearest last."""

    past: tuple[Step, ...] = ()
    future: tuple[Step, ...] = ()


def record(history: History, before: ExplorerState, after: ExplorerState) -> History:
    """Remember an act, unless it did nothing; what had been undone is forgotten."""
    if _work(before) == _work(after):
        return history
    return History((*history.past, Step(before, after))[-UNDO_DEPTH:], ())


def undo(history: History, now: ExplorerState) -> tuple[History, ExplorerState]:
    """One step back, or no step where there is none."""
    if not history.past:
        return history, now
    step = history.past[-1]
    return History(history.past[:-1], (*history.future, step)), _with_work(now, step.before, step.after)


def redo(history: History, now: ExplorerState) -> tuple[History, ExplorerState]:
    """One step forward again, or no step where there is none."""
    if not history.future:
        return history, now
    step = history.future[-1]
    return History((*history.past, step), history.future[:-1]), _with_work(now, step.after, step.before)


def persons(history: History, now: ExplorerState) -> frozenset[int]:
    """Everyone whose fit can be on screen again."""
    return frozenset(
        patient.fit.person for state in _states(history, now) for patient in state.patients if patient.fit
    )


def _work(state: ExplorerState) -> object:
    """What undo brings back; how it is looked at is not work."""
    return state.values, state.patients, state.patient, state.compared, state.pins, state.section


def _with_work(now: ExplorerState, wanted: ExplorerState, left: ExplorerState) -> ExplorerState:
    """``now`` with the work of ``wanted``, and in its layout unless another was chosen since ``left``."""
    layout = wanted.layout if now.layout is left.layout else now.layout
    return with_possible_layout(
        replace(
            now,
            values=wanted.values,
            patients=wanted.patients,
            patient=wanted.patient,
            compared=wanted.compared,
            pins=wanted.pins,
            section=wanted.section,
            layout=layout,
        )
    )


def _states(history: History, now: ExplorerState) -> Iterator[ExplorerState]:
    yield now
    for step in (*history.past, *history.future):
        yield from (step.before, step.after)
