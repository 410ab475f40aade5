"""What a command shows while it works and leaves when it is done: progress bars, Ctrl+C, figures."""

from __future__ import annotations

import contextlib
import json
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from naisr_model.files import replacing

_console = Console(stderr=True)


@contextlib.contextmanager
def bar(label: str) -> Iterator[Callable[[float], None]]:
    """A progress bar, moved by calling what it gives with the share that is done."""
    with Progress(
        TextColumn(label),
        BarColumn(),
        TextColumn("{task.percentage:.0f} %"),
        TimeRemainingColumn(),
        console=_console,
    ) as shown:
        task = shown.add_task(label, total=1.0)
        yield lambda share: shown.update(task, completed=share)


@contextlib.contextmanager
def training_bar() -> Iterator[Callable[[Any], None]]:
    """A progress bar with epoch, loss and speed, moved by calling what it gives with a training's report."""
    columns = (
        TextColumn("epoch {task.fields[epoch]}"),
        BarColumn(),
        TextColumn(
            "loss {task.fields[loss]:.3f}  {task.fields[speed]:,.0f} points/s  {task.fields[left]} left"
        ),
    )
    with Progress(*columns, console=_console) as shown:
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

        yield report


@contextlib.contextmanager
def stoppable() -> Iterator[Callable[[], bool]]:
    """Ctrl+C asks for a clean end; a second one ends at once."""
    asked = False

    def ask(_signal: int, _frame: object) -> None:
        nonlocal asked
        if asked:
            raise KeyboardInterrupt
        asked = True

    previous = signal.signal(signal.SIGINT, ask)
    try:
        yield lambda: asked
    finally:
        signal.signal(signal.SIGINT, previous)


def write_json(path: Path | None, record: object) -> None:
    """Write the figures where a file was named."""
    if path is not None:
        with replacing(path) as temporary:
            temporary.write_text(json.dumps(record, indent=1), encoding="utf-8")
