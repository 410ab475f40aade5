"""What a training tells while it runs: to whoever started it, and to TensorBoard."""

from __future__ import annotations

import os
import socket
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from naisr_model.files import telling

if TYPE_CHECKING:
    from tensorboard.compat.proto.event_pb2 import Event


@dataclass(frozen=True)
class Report:
    """What the loop tells after every iteration.

    Attributes:
        iteration: iterations done.
        share: how much of the training is done, 0 to 1.
        epoch: passes over the training shapes done.
        losses: the weighted terms of this batch and their ``total``.
        points_per_second: points trained on a second, this run.
        seconds_left: at this speed.
    """

    iteration: int
    share: float
    epoch: int
    losses: dict[str, float]
    points_per_second: float
    seconds_left: float


class Log:
    """TensorBoard scalars, one point every ten iterations; goes on where a killed one stopped.

    TensorBoard's own writer has a thread, which a full disk ends with a traceback; its records are written
    here and now instead.

    Args:
        folder: of the event files, one a run.
        iteration: iterations done before; what an earlier run has logged beyond is not shown any more.
    """

    def __init__(self, folder: Path, iteration: int) -> None:
        self.folder, self.iteration = folder, iteration

    def __enter__(self) -> Log:
        from tensorboard.compat.proto.event_pb2 import Event, SessionLog
        from tensorboard.summary.writer.record_writer import RecordWriter

        name = f"events.out.tfevents.{time.time():.6f}.{socket.gethostname()}.{os.getpid()}"
        self._path, first = self.folder / name, self.iteration + 1
        with telling(self._path):
            self.folder.mkdir(parents=True, exist_ok=True)
            self._records = RecordWriter(self._path.open("wb"))
        self._write(Event(step=first, file_version="brain.Event:2"))
        self._write(Event(step=first, session_log=SessionLog(status=SessionLog.START)))
        return self

    def __exit__(self, *_: object) -> None:
        with telling(self._path):
            self._records.close()

    def add(self, report: Report) -> None:
        """Log this iteration's losses.

        Raises:
            InputError: when they cannot be written.
        """
        from tensorboard.compat.proto.event_pb2 import Event
        from tensorboard.compat.proto.summary_pb2 import Summary

        if report.iteration % 10:
            return
        scalars = {f"loss/{name}": value for name, value in report.losses.items()}
        scalars["points_per_second"] = report.points_per_second
        values = [Summary.Value(tag=name, simple_value=value) for name, value in scalars.items()]
        self._write(Event(step=report.iteration, summary=Summary(value=values)))

    def _write(self, event: Event) -> None:
        event.wall_time = time.time()
        with telling(self._path):
            self._records.write(event.SerializeToString())
            self._records.flush()
