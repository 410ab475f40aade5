"""Atlases without a template, in the whole window: of no covariates, and of some that are not told apart."""

from __future__ import annotations

import pytest
from eggs import egg
from PySide6.QtGui import QAction

from naisr_viewer.app import main
from naisr_viewer.engine.engine import Engine
from naisr_viewer.panels.kinds import all_panels, visible_panels
from naisr_viewer.program.headless import finish, run_demo
from naisr_viewer.state.layouts import FULL_SHAPE, TEMPLATE, Layout
from naisr_viewer.state.requests import Panel

TOLERATED = 0.06
"""Share of a volume by which a code that was trained for some seconds may be off."""


@pytest.fixture
def ready(whole_window, egg_deepsdf, tmp_path):
    window, controller = whole_window(Engine(folder=tmp_path / "cache"))
    controller.open(egg_deepsdf)
    finish(window, controller)
    return window, controller


def offered(window) -> set[str]:
    return {action.text() for action in window.findChildren(QAction) if action.isVisible()}


def test_what_the_model_cannot_do_is_absent(ready):
    window, controller = ready
    assert visible_panels(controller.state) == (FULL_SHAPE,)
    assert {panel.kind for panel in all_panels(controller.state.atlas)}.isdisjoint({"template", "effect"})
    assert window.covariates.rows == {} and not window.covariates.reset_all.isVisible()
    texts = offered(window)
    assert {"Full shape", "Fit"} <= texts
    assert texts.isdisjoint({"Side by side", "Before and after", "Reset all covariates"})


def test_the_average_is_shown_exactly_and_again_at_the_next_start(ready, egg_deepsdf, tmp_path):
    _, controller = ready
    assert controller.shown[FULL_SHAPE].is_exact
    again = Engine(folder=tmp_path / "cache")
    again.prepare_previews(again.open(egg_deepsdf).path)
    third = Engine(folder=tmp_path / "cache")
    third.open(egg_deepsdf)
    assert third.was_kept(egg_deepsdf) and not third.has_previews(egg_deepsdf)


def test_a_scan_is_fitted_by_its_code_alone(ready, tmp_path):
    window, controller = ready
    egg(6.0, 1.0).export(tmp_path / "p01.stl")
    window.scan_requested.emit(tmp_path / "p01.stl")
    finish(window, controller)
    assert window.patients.known.rows == {}
    window.patients.known.fit.click()
    finish(window, controller)
    state = controller.state
    assert state.layout is Layout.FIT and state.fit.values == () and state.fit.lasting is None
    assert state.fit.extent == pytest.approx(egg(6.0, 1.0).volume / 1000, rel=TOLERATED)
    assert controller.shown[FULL_SHAPE].request.person == state.person > 0
    assert not window.patients.compare.isVisible()
    window.covariates.reset_all_requested.emit()
    assert controller.state.values == ()
    window.patients.patient_chosen.emit(None)
    finish(window, controller)
    checked = {each.text() for each in window.findChildren(QAction) if each.isChecked() and each.isVisible()}
    assert controller.state.layout is Layout.FULL_SHAPE and "Full shape" in checked


def test_the_demonstration_leaves_out_what_cannot_be_shown(ready, tmp_path):
    window, controller = ready
    run_demo(window, controller, tmp_path)
    pictures = {path.name for path in tmp_path.glob("*.png")}
    assert pictures == {"start.png", "full-shape.png", "patient-fit.png"}
    assert [path.name for path in tmp_path.glob("*.stl")] == ["eggs-full-shape.stl"]


def test_a_setting_of_a_covariate_is_refused_in_words(egg_deepsdf, capsys):
    assert main([str(egg_deepsdf), "--set", "age=3"]) == 2
    assert "depend on no covariates" in capsys.readouterr().err


@pytest.fixture(params=["egg_asdf", "egg_joint", "egg_invertible"])
def with_covariates(request, whole_window, tmp_path):
    window, controller = whole_window(Engine(folder=tmp_path / "cache"))
    controller.open(request.getfixturevalue(request.param))
    finish(window, controller)
    return window, controller


def test_covariates_that_are_not_told_apart_have_sliders_and_one_shape(with_covariates):
    window, controller = with_covariates
    assert list(window.covariates.rows) == ["age", "sex"]
    can = controller.state.atlas.capabilities
    alone = (Panel("effect", "age"), Panel("effect", "sex")) if can.disentangleable else ()
    assert visible_panels(controller.state) == (*([TEMPLATE] if can.has_template else []), *alone, FULL_SHAPE)
    assert ("Side by side" in offered(window)) == can.has_template
    assert "Reset all covariates" in offered(window)
    sex = dict(controller.state.named)["sex"]
    assert sex == (0.0 if can.vanishes_at_centre else -1.0)  # where it knows shapes
    goal = "the population mean (in the middle)" if can.vanishes_at_centre else "F"
    assert window.covariates.rows["sex"].reset.toolTip() == f"Back to {goal}"
    average = egg(dict(controller.state.named)["age"], sex).volume / 1000
    assert controller.shown[FULL_SHAPE].is_exact
    assert controller.shown[FULL_SHAPE].extent == pytest.approx(average, rel=TOLERATED)
    window.covariates.value_moved.emit("age", 8.0)
    window.covariates.value_settled.emit("age", 8.0)
    window.covariates.value_settled.emit("sex", 1.0)
    finish(window, controller)
    shown = controller.shown[FULL_SHAPE]
    assert shown.is_exact and shown.extent == pytest.approx(egg(8.0, 1.0).volume / 1000, rel=TOLERATED)


def test_a_scan_is_fitted_and_seen_on_another_day(with_covariates, tmp_path):
    window, controller = with_covariates
    egg(3.3, 1.0).export(tmp_path / "p01.stl")
    window.scan_requested.emit(tmp_path / "p01.stl")
    finish(window, controller)
    window.patients.known.fit.click()
    finish(window, controller)
    assert controller.state.layout is Layout.FIT and dict(controller.state.fit.values)["age"] > 0
    window.covariates.value_settled.emit("age", 7.2)
    finish(window, controller)
    later = controller.shown[FULL_SHAPE]
    assert later.request.person == controller.state.person > 0
    assert later.extent == pytest.approx(egg(7.2, 1.0).volume / 1000, rel=2 * TOLERATED)
    assert window.error_text.text() == ""
