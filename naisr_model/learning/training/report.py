"""What a training tells while it runs: to whoever started it, and to TensorBoard."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


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
    """TensorBoard scalars, one point every ten iterations; goes on where a killed one stopped."""

    def __init__(self, folder: Path, iteration: int) -> None:
        self.folder, self.iteration = folder, iteration

    def __enter__(self) -> Log:
        from torch.utils.tensorboard import SummaryWriter

        self.writer = SummaryWriter(str(self.folder), purge_step=self.iteration + 1)
        return self

    def __exit__(self, *_: object) -> None:
        self.writer.close()

    def add(self, report: Report) -> None:
        """Log this iteration's losses."""
        if report.iteration % 10:
            return
        for name, value in report.losses.items():
            self.writer.add_scalar(f"loss/{name}", value, report.iteration)
        self.writer.add_scalar("points_per_second", report.points_per_second, report.iteration)
