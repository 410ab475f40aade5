"""What a command shows while it works and leaves when it is done: progress with Ctrl+C, figures."""

from __future__ import annotations

import contextlib
import json
import signal
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

from rich.console import Console
from rich.progress import BarColumn, ProgressColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as RichProgress

from naisr_model.files import replacing
from naisr_model.progress import Progress
from naisr_model.terminal import say

LINE_S = 60.0
"""Between two lines where no bar can be drawn."""

_console = Console(stderr=True)


@contextlib.contextmanager
def bar(label: str) -> Iterator[Progress]:
    """A bar that shows the progress it hands out, which Ctrl+C stops."""
    with _shown(label, TimeRemainingColumn()) as (display, progress):
        yield replace(progress, told=lambda share: display.show(share, f"{100 * share:.0f} %"))


@contextlib.contextmanager
def training_bar() -> Iterator[tuple[Progress, Callable[[Any], None]]]:
    """A bar with epoch, loss and speed: the progress that Ctrl+C stops, and what is called with reports."""
    with _shown("training") as (display, progress):

        def report(told: Any) -> None:
            minutes, seconds = divmod(int(told.seconds_left), 60)
            loss, speed = told.losses["total"], told.points_per_second
            left = f"{minutes}:{seconds:02d} left"
            display.show(told.share, f"epoch {told.epoch}  loss {loss:.3f}  {speed:,.0f} points/s  {left}")

        yield progress, report


class Display(Protocol):
    """Where progress is shown."""

    def begin(self) -> None:
        """The work goes on: called often, and not before the input was checked."""

    def show(self, share: float, words: str) -> None:
        """So much is done, 0 to 1, which ``words`` say."""

    def end(self, is_done: bool) -> None:
        """Nothing more comes, because the work is done or has failed."""


class Drawn:
    """A bar on a terminal."""

    def __init__(self, label: str, *columns: ProgressColumn) -> None:
        known = TextColumn(label), BarColumn(), TextColumn("{task.fields[words]}")
        self._bar = RichProgress(*known, *columns, console=_console)
        self._task = self._bar.add_task(label, total=1.0, words="")

    def begin(self) -> None:
        """Draw it."""
        self._bar.start()

    def show(self, share: float, words: str) -> None:
        """Fill it."""
        self._bar.update(self._task, completed=share, words=words)

    def end(self, is_done: bool) -> None:
        """Leave it as it is."""
        if self._bar.live.is_started:
            self._bar.stop()


class Lines:
    """A plain line now and then, as a file keeps it; from a thread, whatever the work does."""

    def __init__(self, label: str) -> None:
        self._label, self._words = label, "begun"
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._tell, name="naisr-lines", daemon=True)

    def begin(self) -> None:
        """From now on."""
        if self._thread.ident is None:
            self._thread.start()

    def show(self, _share: float, words: str) -> None:
        """In the next line."""
        self._words = words

    def end(self, is_done: bool) -> None:
        """With a last line."""
        if self._thread.ident is None:
            return
        self._ended.set()
        self._thread.join()
        if is_done:
            say(f"{self._label}: {self._words}")

    def _tell(self) -> None:
        while not self._ended.wait(LINE_S):
            say(f"{self._label}: {self._words}")


@contextlib.contextmanager
def _shown(label: str, *columns: ProgressColumn) -> Iterator[tuple[Display, Progress]]:
    """A display from the first time on that the work asks whether to go on."""
    display: Display = Drawn(label, *columns) if _console.is_terminal else Lines(label)

    def is_unwanted() -> bool:
        display.begin()
        return silent.is_unwanted()

    is_done = False
    try:
        with stoppable() as silent:
            yield display, replace(silent, is_unwanted=is_unwanted)
        is_done = True
    finally:
        display.end(is_done)


@contextlib.contextmanager
def stoppable() -> Iterator[Progress]:
    """A progress that shows nothing: Ctrl+C asks for a clean end; a second one ends at once.

    Raises:
        Cancelled: when the work did not ask after the Ctrl+C.
    """
    asked = False

    def ask(_signal: int, _frame: object) -> None:
        nonlocal asked
        if asked:
            raise KeyboardInterrupt
        asked = True

    previous = signal.signal(signal.SIGINT, ask)
    try:
        yield (progress := Progress(is_unwanted=lambda: asked))
        progress.check()
    finally:
        signal.signal(signal.SIGINT, previous)


@contextlib.contextmanager
def told_anyway(tell: Callable[[], object]) -> Iterator[None]:
    """Write what was found out, then tell it: no file depends on who listens, and no word on a full disk."""
    try:
        yield
    finally:
        tell()


def write_json(path: Path | None, record: object) -> None:
    """Write the figures where a file was named."""
    if path is not None:
        with replacing(path) as temporary:
            temporary.write_text(json.dumps(record, indent=1), encoding="utf-8")
