"""What a training tells TensorBoard, read by TensorBoard's own reader."""

from __future__ import annotations

from pathlib import Path

import pytest
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from naisr_model.errors import InputError
from naisr_model.learning.training.report import Log, Report


def report(iteration: int, total: float) -> Report:
    return Report(iteration, 0.5, 1, {"total": total}, 1000.0, 60.0)


def logged(folder: Path) -> dict[int, float]:
    reader = EventAccumulator(str(folder))
    reader.Reload()
    return {each.step: each.value for each in reader.Scalars("loss/total")}


def test_losses_are_logged_and_a_run_that_goes_on_takes_the_place_of_what_was_lost(tmp_path):
    with Log(tmp_path, 0) as log:
        for iteration in range(1, 41):
            log.add(report(iteration, 1 / iteration))
    assert logged(tmp_path) == pytest.approx({10: 0.1, 20: 0.05, 30: 1 / 30, 40: 0.025})
    with Log(tmp_path, 25) as log:  # killed after it had saved at 25
        for iteration in range(26, 51):
            log.add(report(iteration, 2.0))
    assert logged(tmp_path) == pytest.approx({10: 0.1, 20: 0.05, 30: 2.0, 40: 2.0, 50: 2.0})


def test_a_log_that_finds_no_room_is_a_sentence(tmp_path, no_room):
    sentence = r"cannot write \S*tfevents\S*: File too large; [^\n]*$"
    with no_room(300), pytest.raises(InputError, match=sentence), Log(tmp_path, 0) as log:
        for iteration in range(1, 200):
            log.add(report(iteration, 1.0))
