"""The acts that can be undone, with the fits that they refer to."""

from __future__ import annotations

from naisr_viewer.engine.engine import Engine
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.history import History, persons, record, redo, undo


class Timeline:
    """What was before and after the present state.

    Args:
        engine: answers for everyone who was fitted, as long as a state here refers to the fit.
    """

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._history = History()
        self._held: frozenset[int] = frozenset()

    @property
    def can_undo(self) -> bool:
        """Whether anything lies behind."""
        return bool(self._history.past)

    @property
    def can_redo(self) -> bool:
        """Whether anything that was undone lies ahead."""
        return bool(self._history.future)

    def record(self, before: ExplorerState, after: ExplorerState) -> None:
        """Remember an act, unless it did nothing."""
        self._history = record(self._history, before, after)

    def back(self, now: ExplorerState) -> ExplorerState:
        """The state before the last act."""
        self._history, state = undo(self._history, now)
        return state

    def forward(self, now: ExplorerState) -> ExplorerState:
        """The state after the act that was undone last."""
        self._history, state = redo(self._history, now)
        return state

    def begin(self) -> None:
        """Another atlas is open; nothing before it can be brought back."""
        self._history = History()

    def release(self, now: ExplorerState) -> None:
        """Forget the fits that no state refers to any more, neither ``now`` nor one remembered."""
        held = persons(self._history, now)
        for person in self._held - held:
            self._engine.dismiss(person)
        self._held = held
