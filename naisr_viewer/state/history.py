"""What was before and after the present covariate values."""

from __future__ import annotations

from dataclasses import dataclass

from naisr_viewer.state.atlas_card import RealVector

UNDO_DEPTH = 200
"""How many covariate changes are remembered."""


@dataclass(frozen=True)
class History:
    """Covariate values before and after the present ones, nearest last."""

    past: tuple[RealVector, ...] = ()
    future: tuple[RealVector, ...] = ()


def record(history: History, before: RealVector, now: RealVector) -> History:
    """Remember ``before``, unless nothing changed; what had been undone is forgotten."""
    if before == now:
        return history
    return History((*history.past, before)[-UNDO_DEPTH:], ())


def undo(history: History, now: RealVector) -> tuple[History, RealVector]:
    """One step back, or no step where there is none."""
    if not history.past:
        return history, now
    return History(history.past[:-1], (*history.future, now)), history.past[-1]


def redo(history: History, now: RealVector) -> tuple[History, RealVector]:
    """One step forward again, or no step where there is none."""
    if not history.future:
        return history, now
    return History((*history.past, now), history.future[:-1]), history.future[-1]
