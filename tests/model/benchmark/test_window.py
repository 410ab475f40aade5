"""What the window measures of itself."""

import dataclasses

from naisr_model.atlas import Atlas
from naisr_model.benchmark import window
from naisr_model.benchmark.subject import QUICK, Subject


def test_what_the_window_says_of_itself_is_passed_on(egg_atlas, monkeypatch):
    told = iter(
        [dict.fromkeys(window.WINDOW, value) | {"events": 10, "frames_dropped": 4} for value in (3, 1, 2)]
    )
    monkeypatch.setattr(window, "watched", lambda atlas, file, device: next(told))
    scope = dataclasses.replace(QUICK, viewer_runs=3)
    figures = window.measure(Subject(egg_atlas, Atlas.load(egg_atlas), scope))
    assert figures == dict.fromkeys(window.WINDOW, 2.0) | {"frames_dropped_share": 0.4}
