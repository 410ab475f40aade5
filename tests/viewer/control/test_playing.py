"""A covariate that plays, in the whole window."""

from __future__ import annotations

from dataclasses import replace

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest

from naisr_viewer.engine.engine import Engine
from naisr_viewer.program.headless import finish, pause
from naisr_viewer.state.explorer import ExplorerState, opened, with_values
from naisr_viewer.state.layouts import FULL_SHAPE
from naisr_viewer.state.sweep import sweep_of


@pytest.fixture
def ready(whole_window, egg_atlas, egg_cache, qtbot):
    window, controller = whole_window(Engine(folder=egg_cache))
    controller.open(egg_atlas)
    finish(window, controller)
    window.covariates.value_settled.emit("age", 3.0)
    finish(window, controller)
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)  # only then it hears keys
    return window, controller


def ages(controller, qtbot, count: int) -> list[float]:
    """Of the shapes on screen, until there were so many."""
    seen: list[float] = []

    def enough() -> bool:
        age = dict(controller.shown[FULL_SHAPE].request.values)["age"]
        if not seen or seen[-1] != age:
            seen.append(age)
        return len(seen) > count

    qtbot.waitUntil(enough)
    return seen


def test_the_covariate_moved_last_plays_until_it_is_stopped_in_one_step(ready, qtbot):
    window, controller = ready
    QTest.keyClick(window, Qt.Key.Key_F5)
    seen = ages(controller, qtbot, 4)
    assert seen[0] == 3.0 and seen == sorted(seen) and controller.is_moving
    QTest.keyClick(window, Qt.Key.Key_F5)
    finish(window, controller)
    here = dict(controller.state.named)["age"]
    assert not controller.is_moving and here > 3.0 and controller.shown[FULL_SHAPE].is_exact
    pause(0.3)
    assert dict(controller.state.named)["age"] == here
    controller.undo()
    assert dict(controller.state.named)["age"] == 3.0
    finish(window, controller)


def test_a_hand_on_a_slider_takes_over_and_undo_ends_it(ready, qtbot):
    window, controller = ready
    window.play_requested.emit()
    ages(controller, qtbot, 2)
    window.covariates.value_moved.emit("sex", 0.5)
    window.covariates.value_settled.emit("sex", 1.0)
    age = dict(controller.state.named)["age"]
    pause(0.3)
    assert dict(controller.state.named) == {"age": age, "sex": 1.0}
    window.play_requested.emit()
    pause(0.2)
    controller.undo()
    now = controller.state.values
    pause(0.3)
    assert controller.state.values == now and not controller.is_moving
    finish(window, controller)


def test_each_slider_has_a_button_that_plays_it(ready, qtbot):
    window, controller = ready
    age, sex = (window.covariates.rows[name].play for name in ("age", "sex"))
    qtbot.mouseClick(age, Qt.MouseButton.LeftButton)
    ages(controller, qtbot, 2)
    assert age.isChecked() and not sex.isChecked()
    qtbot.mouseClick(sex, Qt.MouseButton.LeftButton)
    stopped = dict(controller.state.named)["age"]
    start = dict(controller.state.named)["sex"]
    qtbot.waitUntil(lambda: dict(controller.state.named)["sex"] != start)
    assert sex.isChecked() and not age.isChecked() and dict(controller.state.named)["age"] == stopped > 3.0
    qtbot.mouseClick(sex, Qt.MouseButton.LeftButton)
    finish(window, controller)
    assert not sex.isChecked() and not controller.is_moving
    for name, earlier in (("sex", start), ("age", 3.0)):
        controller.undo()
        assert dict(controller.state.named)[name] == earlier
    finish(window, controller)


def test_it_goes_to_and_fro_between_the_ends(card):
    state = with_values(opened(ExplorerState(), card), (("age", 1.0),))
    sweep = sweep_of(replace(state, touched="age"))
    assert sweep is not None
    low, high = card.covariates[0].range
    assert [sweep.after(sweeps) for sweeps in (0, 1, 2, 3)] == [low, high, low, high] == [1, 220, 1, 220]
    assert sweep.after(0.5) == sweep.after(1.5) == pytest.approx((low + high) / 2, abs=1)
    assert sweep_of(ExplorerState()) is None
    chosen = sweep_of(replace(state, touched="age"), "sex")
    assert chosen is not None and chosen.covariate.name == "sex"
