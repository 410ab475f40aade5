"""The stop-watch: what it makes of its observations, and one run of the whole program under it."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from naisr_viewer.program import measure
from naisr_viewer.program.measure import Picture

ROOT = Path(__file__).parents[3]


def pictures(*shown: tuple[float, tuple[float, ...]]) -> list[Picture]:
    return [Picture(moment, values, complete=False) for moment, values in shown]


def test_a_change_is_answered_by_the_first_picture_of_it_or_of_a_later_one():
    events = [(0.0, 10.0), (1.0, 20.0), (2.0, 30.0)]
    seen = pictures((0.5, (10.0,)), (3.0, (30.0,)))
    assert measure.first_shown(events, seen) == [(0.0, 0.5), (1.0, 3.0), (2.0, 3.0)]


def test_a_change_is_answered_only_when_every_sub_plot_shows_it():
    events = [(0.0, 10.0), (1.0, 20.0)]
    seen = pictures((1.5, (20.0, 10.0)), (2.5, (20.0, 20.0)))
    assert measure.first_shown(events, seen) == [(0.0, 1.5), (1.0, 2.5)]


def test_a_value_on_the_way_back_is_not_mistaken_for_the_one_on_the_way_there():
    events = [(0.0, 10.0), (1.0, 20.0), (2.0, 10.0)]
    again = pictures((0.5, (10.0,)), (2.5, (10.0,)))  # painted twice with the first value
    assert measure.first_shown(events, again) == [(0.0, 0.5)]
    early = pictures((0.5, (10.0,)), (1.5, (20.0,)), (2.5, (10.0,)))
    assert measure.first_shown(events, early) == [(0.0, 0.5), (1.0, 1.5), (2.0, 2.5)]


def test_pictures_of_foreign_values_answer_nothing():
    assert measure.first_shown([(0.0, 10.0)], pictures((1.0, (99.0,)), (2.0, ()))) == []


def test_the_handle_swings_from_end_to_end():
    assert measure.swing(0.0) == 0.5
    assert measure.swing(measure.SWING_S / 2) == 1.0
    assert measure.swing(1.5 * measure.SWING_S) == pytest.approx(0.0)
    assert measure.swing(2 * measure.SWING_S) == pytest.approx(0.5)


def test_the_start_of_the_process_lies_behind():
    started = measure.process_start(loaded=time.monotonic())
    assert 0 < time.monotonic() - started < 24 * 3600


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="needs a virtual display")
def test_the_whole_program_is_timed_without_any_display(egg_atlas, tmp_path):
    report = tmp_path / "report.json"
    code = (
        "import sys; from naisr_viewer import app; from naisr_viewer.program import measure; "
        "measure.DRAG_S = 1.0; "
        f"sys.exit(app.main([{str(egg_atlas)!r}, '--measure', {str(report)!r}, '--size', '800x600']))"
    )
    hidden = ("DISPLAY", "WAYLAND_DISPLAY")
    environment = {name: value for name, value in os.environ.items() if name not in hidden}
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env={**environment, "XDG_CACHE_HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    figures = json.loads(report.read_text())
    assert 0 < figures["window_visible_s"] < figures["first_picture_s"]
    assert figures["first_picture_was_kept"] is False
    assert figures["first_picture_s"] < figures["previews_ready_s"]
    assert figures["covariate"] == "age"
    assert figures["views"] == 4
    assert figures["events"] == figures["frames"] + figures["frames_dropped"]
    assert figures["frames"] >= 1
    assert 0 < figures["event_to_picture_median_ms"] <= figures["event_to_picture_p95_ms"]
    assert figures["queue_after_drag"] <= 1  # what was being computed when the mouse was released
    assert figures["release_to_exact_s"] > 0
