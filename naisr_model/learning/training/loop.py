"""Training: one loop over random batches of shapes, resumable at any moment.

Every draw is a function of (seed, iteration), so a training that was killed and started again ends
with the same weights as one that was not.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path

from naisr_model.checkpoint import Checkpoint
from naisr_model.config import Preset
from naisr_model.data.store import SampleStore
from naisr_model.errors import Cancelled, InputError
from naisr_model.learning.training.kept import held, keep_template, measured, resume, save
from naisr_model.learning.training.report import Log, Report
from naisr_model.learning.training.step import accumulate_gradients
from naisr_model.learning.training.task import State, Task, initial_state, make_task
from naisr_model.models.devices import quick_products
from naisr_model.progress import SILENT, Progress

SAVE_SECONDS = 60.0

DIVERGED = 20.0
"""A loss this many times its best running mean means that the training has broken down."""


def train(
    store: SampleStore,
    preset: Preset,
    out: Path,
    *,
    time_budget_s: float = math.inf,
    report: Callable[[Report], None] | None = None,
    progress: Progress = SILENT,
    device: str = "cpu",
) -> Checkpoint:
    """Train an atlas on the store's training rows and write it to ``out``.

    ``out`` is a usable atlas from the first minute on. Beside it, ``<out>.training/`` keeps the
    state to resume from, the TensorBoard log and the template at the chosen epochs.

    Args:
        store: prepared samples.
        preset: networks and settings.
        out: the checkpoint to write.
        time_budget_s: ends the training after so many seconds, earlier stops included; the learning
            rates then follow the clock, so only a training without it gives the same result twice.
        report: called after every iteration.
        progress: told the finished share, checked once an iteration.
        device: where torch computes.

    Returns:
        The checkpoint that was written.

    Raises:
        InputError: when settings and data do not fit, something else stands at ``out`` or writes there, it
            cannot be written, or the loss becomes NaN or breaks away; the last good state is kept.
        Cancelled: when nobody waits for it any more; the state reached is kept.
    """
    task = make_task(store, preset, out, time_budget_s, device)
    with held(task), quick_products(device):
        return _train(task, report, progress)


def _train(task: Task, report: Callable[[Report], None] | None, progress: Progress) -> Checkpoint:
    state = initial_state(task)
    resume(state, task)
    _require_sound(task, progress if state.share(task) < 1 else SILENT)
    first, began, saved = state.iteration, time.monotonic(), time.monotonic()
    with Log(task.folder / "tensorboard", state.iteration) as log:
        while state.share(task) < 1:
            started = time.monotonic()
            losses = accumulate_gradients(state, task)
            _judge(losses["total"], state, task)
            _follow(losses["total"], state)
            # Only weights whose loss was just found sound are ever written.
            is_unwanted = progress.is_unwanted()
            if is_unwanted or started - saved > SAVE_SECONDS:
                _require_finite(state, task)
                save(state, task)
                saved = time.monotonic()
            if is_unwanted:
                raise Cancelled
            for optimiser in state.optimisers:
                optimiser.step()
            state.iteration += 1
            keep_template(state, task)
            state.seconds += time.monotonic() - started
            told = _report(state, task, losses, (time.monotonic() - began) / (state.iteration - first))
            log.add(told)
            progress.tell(min(1.0, told.share))
            if report is not None:
                report(told)
    # The last step is judged like the others, by the loss of the step that would follow.
    _judge(accumulate_gradients(state, task)["total"], state, task)
    _require_finite(state, task)
    save(state, task)
    return save(state, task, measured(state, task))


def _require_sound(task: Task, progress: Progress) -> None:
    """Stop before anything is written where samples are damaged, that no later batch meets them."""
    config = task.config
    for row in task.rows:
        task.store.require_sound(row, config.surface_points, config.near_points, config.uniform_points)
        if progress.is_unwanted():
            raise Cancelled


def _judge(total: float, state: State, task: Task) -> None:
    """Stop where the loss has become NaN or has broken away."""
    if not math.isfinite(total) or total > DIVERGED * max(state.best, 1e-3):
        raise InputError(_divergence_message(total, state, task))


def _require_finite(state: State, task: Task) -> None:
    """Stop where weights or codes that this batch had no use for are not numbers."""
    if not state.is_finite:
        raise InputError(_divergence_message(math.nan, state, task))


def _follow(total: float, state: State) -> None:
    """Keep the mean of the loss of late, and the lowest."""
    state.running = total if math.isinf(state.running) else 0.98 * state.running + 0.02 * total
    state.best = min(state.best, state.running)


def _divergence_message(total: float, state: State, task: Task) -> str:
    config, out = task.config, task.out
    rates = (*state.model.rated_parameters(), "latent_rate")
    lower = [f"a {name} below {getattr(config, name):g}" for name in rates]
    kept = f"the last good state is in {out}" if out.exists() else "no good state had been saved"
    return (
        f"the training broke down at iteration {state.iteration} (loss {total:.3g}); {kept}; try again "
        f"under another name with {', '.join(lower)} or a lower omega0"
    )


def _report(state: State, task: Task, losses: dict[str, float], seconds_each: float) -> Report:
    epoch = state.iteration // task.epoch_iterations
    points = len(task.rows) * task.config.shape_points / task.epoch_iterations
    left = min((task.iterations - state.iteration) * seconds_each, task.budget_s - state.seconds)
    return Report(state.iteration, state.share(task), epoch, losses, points / seconds_each, max(0.0, left))
