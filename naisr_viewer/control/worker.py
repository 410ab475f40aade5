"""Runs the newest job beside the window; knows nothing of what a job does.

Each job gets a generation number. ``submit`` lets a running job finish and replaces the one that
waits, so a stream of submissions leaves no queue and none starves. ``cancel`` makes everything
submitted so far stale: a running job is asked to stop by polling, and whatever it still reports
is dropped on the thread of the window.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from threading import Condition, Thread
from typing import Any, TypeVar

from PySide6.QtCore import QObject, QTimer, Signal, Slot

from naisr_model.progress import Progress

REPORT_INTERVAL_S = 0.05
"""Progress reports closer together than this are left out."""

Result = TypeVar("Result")

Deliver = Callable[[Result], None]
"""Hands a result over to whoever asked for it, on the window's thread."""

Job = Callable[[Deliver[Result], Progress], None]
"""Work to be done off the window's thread; it may hand over several results."""


class Worker(QObject):
    """One thread and at most one waiting job.

    Args:
        parent: Qt parent.
        synchronous: run every job inside ``submit``, for tests.
    """

    progressed = Signal(float)  # fraction 0..1 of the running job
    failed = Signal(object)  # a job that is not stale raised this exception
    idle = Signal()  # the last job ended, whichever way, and none waits

    _reported = Signal(int, str, object)  # generation, signal name, payload; crosses the threads

    def __init__(self, parent: QObject | None = None, *, synchronous: bool = False) -> None:
        super().__init__(parent)
        self._generation = 0
        self._oldest_valid = 0
        self._started = 0
        self._running = self._owes = False
        self._waiting: tuple[int, Job[Any], Deliver[Any]] | None = None
        self._closed = False
        self._changed = Condition()
        self._reported.connect(self._relay)
        self._thread = None if synchronous else Thread(target=self._loop, name="naisr-worker", daemon=True)
        if self._thread is not None:
            self._thread.start()

    def submit(self, job: Job[Result], then: Deliver[Result]) -> None:
        """Run ``job`` next; a job that still waits is forgotten.

        Args:
            job: what to do.
            then: given each of its results, unless it is stale by then.
        """
        with self._changed:
            if self._closed:
                return
            self._generation += 1
            self._waiting = (self._generation, job, then)
            self._owes = True
            self._changed.notify()
        if self._thread is None:
            self._run_waiting()

    @property
    def is_busy(self) -> bool:
        """Whether something that was submitted has not been answered, given up or refused yet."""
        return self._owes

    def cancel(self) -> None:
        """Make everything submitted so far stale; :attr:`idle` follows, even if nothing had begun."""
        with self._changed:
            self._oldest_valid = self._generation + 1
            dropped, self._waiting = self._waiting, None
            if dropped is not None and not self._running:
                self._started = dropped[0]
                QTimer.singleShot(0, self, lambda: self._relay(dropped[0], "idle", None))

    def close(self) -> None:
        """Cancel and wait for the thread to end; nothing is reported any more."""
        self.cancel()
        with self._changed:
            self._closed = True
            self._changed.notify()
        if self._thread is not None:
            self._thread.join()

    def _is_stale(self, generation: int) -> bool:
        return generation < self._oldest_valid

    def _loop(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._closed or self._waiting is not None)
                if self._closed:
                    return
            self._run_waiting()

    def _run_waiting(self) -> None:
        with self._changed:
            if self._waiting is None:
                return
            (generation, job, then), self._waiting = self._waiting, None
            self._started, self._running = generation, True
        try:
            job(
                lambda result: self._reported.emit(generation, "delivered", (then, result)),
                Progress(self._thinned(generation), lambda: self._is_stale(generation)),
            )
        except Exception as error:  # whatever it is, the user is told in the window
            self._reported.emit(generation, "failed", error)
        self._running = False
        self._reported.emit(generation, "idle", None)

    def _thinned(self, generation: int) -> Callable[[float], None]:
        last = time.monotonic()

        def report(fraction: float) -> None:
            nonlocal last
            if time.monotonic() - last >= REPORT_INTERVAL_S:
                last = time.monotonic()
                self._reported.emit(generation, "progressed", fraction)

        return report

    @Slot(int, str, object)
    def _relay(self, generation: int, signal: str, payload: Any) -> None:
        if self._closed:
            return
        if signal == "idle":
            if self._waiting is None and generation == self._started:
                self._owes = False
                self.idle.emit()
        elif self._is_stale(generation):
            return
        elif signal == "delivered":
            then, result = payload
            then(result)
        else:
            getattr(self, signal).emit(payload)
