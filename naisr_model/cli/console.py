"""What a command shows while it works and leaves when it is done: progress with Ctrl+C, figures."""

from __future__ import annotations

import contextlib
import json
import signal
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

from naisr_model.files import replacing
from naisr_model.progress import Progress

_console = Console(stderr=True)


@contextlib.contextmanager
def bar(label: str) -> Iterator[Progress]:
    """A bar that shows the progress it hands out, which Ctrl+C stops."""
    columns = TextColumn(label), BarColumn(), TextColumn("{task.percentage:.0f} %"), TimeRemainingColumn()
    with _drawn(Bar(*columns, console=_console)) as (shown, progress):
        task = shown.add_task(label, total=1.0)
        yield replace(progress, told=lambda share: shown.update(task, completed=share))


@contextlib.contextmanager
def training_bar() -> Iterator[tuple[Progress, Callable[[Any], None]]]:
    """A bar with epoch, loss and speed: the progress that Ctrl+C stops, and what is called with reports."""
    columns = (
        TextColumn("epoch {task.fields[epoch]}"),
        BarColumn(),
        TextColumn(
            "loss {task.fields[loss]:.3f}  {task.fields[speed]:,.0f} points/s  {task.fields[left]} left"
        ),
    )
    with _drawn(Bar(*columns, console=_console)) as (shown, progress):
        task = shown.add_task("training", total=1.0, epoch=0, loss=float("nan"), speed=0.0, left="?")

        def report(told: Any) -> None:
            minutes, seconds = divmod(int(told.seconds_left), 60)
            shown.update(
                task,
                completed=told.share,
                epoch=told.epoch,
                loss=told.losses["total"],
                speed=told.points_per_second,
                left=f"{minutes}:{seconds:02d}",
            )

        yield progress, report


@contextlib.contextmanager
def _drawn(shown: Bar) -> Iterator[tuple[Bar, Progress]]:
    """A bar from the first time on that the work asks whether to go on: before, its input is checked."""

    def is_unwanted() -> bool:
        shown.start()
        return silent.is_unwanted()

    with stoppable() as silent:
        try:
            yield shown, replace(silent, is_unwanted=is_unwanted)
        finally:
            if shown.live.is_started:
                shown.stop()


@contextlib.contextmanager
def stoppable() -> Iterator[Progress]:
    """A progress that shows nothing: Ctrl+C asks for a clean end; a second one ends at once."""
    asked = False

    def ask(_signal: int, _frame: object) -> None:
        nonlocal asked
        if asked:
            raise KeyboardInterrupt
        asked = True

    previous = signal.signal(signal.SIGINT, ask)
    try:
        yield Progress(is_unwanted=lambda: asked)
    finally:
        signal.signal(signal.SIGINT, previous)


def write_json(path: Path | None, record: object) -> None:
    """Write the figures where a file was named."""
    if path is not None:
        with replacing(path) as temporary:
            temporary.write_text(json.dumps(record, indent=1), encoding="utf-8")
