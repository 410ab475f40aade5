"""The wiring, without a screen: a window that only remembers what it was told, a worker without a thread."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from unittest.mock import Mock, create_autospec

import pytest
from PySide6.QtCore import QObject, QSettings, Signal
from PySide6.QtGui import QImage

from naisr_model import __version__
from naisr_model.errors import InputError
from naisr_model.progress import Progress
from naisr_viewer.control.controller import Controller
from naisr_viewer.control.preferences import Preferences
from naisr_viewer.control.worker import Worker
from naisr_viewer.panels.kinds import panels_in, request_for
from naisr_viewer.state.layouts import FULL_SHAPE, TEMPLATE, Layout, Panel
from naisr_viewer.state.questions import CLOSE_WINDOW, OPEN_ATLAS, REPLACE_FILES, Answer
from naisr_viewer.state.requests import (
    EXACT_RESOLUTION,
    PREVIEW_RESOLUTION,
    ExportChoice,
    Origin,
    SurfaceResult,
)
from naisr_viewer.state.support import Support
from naisr_viewer.state.theme import ThemeChoice
from naisr_viewer.views.covariates.panel import CovariatePanel
from naisr_viewer.views.main_window import MainWindow
from naisr_viewer.views.shapes.shape_view import ShapeView
from naisr_viewer.words.numbers import in_words

AGE_ONLY = Panel("effect", "age")


class WindowSignals(QObject):
    open_requested = Signal(Path)
    export_requested = Signal(object)
    screenshot_requested = Signal(Path)
    undo_requested = Signal()
    redo_requested = Signal()
    layout_requested = Signal(object)
    theme_requested = Signal(object)
    drawer_requested = Signal(object)
    quantity_chosen = Signal(object)
    shared_toggled = Signal(bool)
    cancel_requested = Signal()
    about_requested = Signal()
    preferences_requested = Signal()
    edges_switched = Signal()
    close_requested = Signal(object)
    closing = Signal()


class PanelSignals(QObject):
    value_moved = Signal(str, float)
    value_settled = Signal(str, float)
    values_moved = Signal(object)
    values_settled = Signal(object)
    support_requested = Signal(object)
    reset_requested = Signal(str)
    reset_all_requested = Signal()
    mute_toggled = Signal(str, bool)
    refused = Signal(str)
    solo_toggled = Signal(str, bool)
    follow_toggled = Signal(bool)


class ShapeSignals(QObject):
    drawn = Signal(int)
    limit_moved = Signal(object, float)
    fit_requested = Signal(object)


def with_signals(fake: Mock, signals: QObject) -> Mock:
    for name in vars(type(signals)):
        if isinstance(vars(type(signals))[name], Signal):
            setattr(fake, name, getattr(signals, name))
    fake.signals = signals
    return fake


@pytest.fixture
def window(qapp: QObject) -> Mock:
    fake = with_signals(create_autospec(MainWindow, instance=True), WindowSignals())
    fake.covariates = with_signals(create_autospec(CovariatePanel, instance=True), PanelSignals())
    fake.shapes = with_signals(create_autospec(ShapeView, instance=True), ShapeSignals())
    return fake


@pytest.fixture
def controller(window, engine, settings) -> Controller:
    return Controller(
        window, engine, Worker(synchronous=True), Worker(synchronous=True), Preferences(settings)
    )


@pytest.fixture
def ready(controller, atlas_file, atlas) -> Controller:
    """The atlas open and everything exact."""
    controller.open(atlas_file)
    atlas.calls.clear()
    return controller


def status(window: Mock) -> str:
    return str(window.show_status.call_args.args[0])


def drawn(window: Mock) -> list[SurfaceResult]:
    return [call.args[0] for call in window.shapes.show_surface.call_args_list]


def test_opening_shows_coarse_surfaces_first_and_exact_ones_at_last(controller, window, atlas_file, card):
    controller.open(atlas_file)
    sizes = [result.request.resolution for result in drawn(window)]
    assert sizes == [PREVIEW_RESOLUTION] * 5 + [EXACT_RESOLUTION] * 5
    assert set(controller.shown) == set(panels_in(Layout.SIDE_BY_SIDE, card))
    assert status(window).startswith(f"Exact {EXACT_RESOLUTION}³ in ")
    assert not controller.is_busy


def test_dragging_age_carries_only_what_age_changes_and_asks_no_network(ready, window, atlas):
    window.covariates.value_settled.emit("sex", 1.0)
    atlas.calls.clear()
    window.shapes.show_surface.reset_mock()
    for value in (110.0, 120.0, 130.0):
        window.covariates.value_moved.emit("age", value)
    assert atlas.calls == []
    assert {result.request.panel for result in drawn(window)} == {AGE_ONLY, FULL_SHAPE}
    assert {result.origin for result in drawn(window)} == {Origin.TABLES}
    assert len({id(result.faces) for result in drawn(window)}) == 1
    assert status(window).startswith("Preview in ")
    assert ready.shown[AGE_ONLY].extent == pytest.approx(atlas.volume_cm3(age=130.0), rel=0.01)
    window.covariates.value_settled.emit("age", 130.0)
    assert [(what, size) for what, _, size in atlas.calls] == [
        ("shape", EXACT_RESOLUTION),
        ("age", EXACT_RESOLUTION),
    ]
    assert status(window).startswith(f"Exact {EXACT_RESOLUTION}³")


def test_after_a_drag_the_status_line_says_how_far_off_the_preview_was(ready, window):
    window.covariates.value_moved.emit("age", 130.0)
    window.covariates.value_settled.emit("age", 130.0)
    assert "99 % of the preview was within 0.01 mm" in status(window)


def test_a_preview_that_folds_is_marked_until_the_exact_surface_is_there(ready, window):
    window.covariates.value_moved.emit("age", 210.0)
    assert "preview uncertain" in window.shapes.set_caption.call_args.args[1]
    window.covariates.value_settled.emit("age", 210.0)
    captions = {call.args[0]: call.args[1] for call in window.shapes.set_caption.call_args_list}
    assert "preview uncertain" not in captions[AGE_ONLY]


def test_dragging_works_coarsely_until_displacements_are_tabulated(held, window, atlas):
    controller, worker = held
    window.covariates.value_moved.emit("age", 130.0)
    worker.run()
    assert controller.shown[AGE_ONLY].origin is Origin.NETWORK
    assert status(window).startswith(f"Preview {PREVIEW_RESOLUTION}³")


def test_what_fails_in_the_background_is_told_and_dragging_stays_coarse(
    controller, window, atlas, atlas_file, monkeypatch
):
    monkeypatch.setattr(atlas, "tabulate", Mock(side_effect=MemoryError("no room")))
    controller.open(atlas_file)
    assert "Previews stay coarse" in window.show_error.call_args.args[0]
    window.covariates.value_moved.emit("age", 130.0)
    assert controller.shown[AGE_ONLY].origin is Origin.NETWORK


def test_the_volume_beneath_a_shape_is_that_of_the_shape(ready, window, atlas):
    window.covariates.value_settled.emit("age", 200.0)
    captions = {call.args[0]: call.args[1] for call in window.shapes.set_caption.call_args_list}
    for panel in (AGE_ONLY, FULL_SHAPE):
        assert f"{ready.shown[panel].extent:.1f} cm³" in captions[panel]
        assert ready.shown[panel].extent == pytest.approx(atlas.volume_cm3(age=200.0), rel=0.01)


def test_a_combination_nobody_has_is_marked(ready, window):
    window.covariates.value_settled.emit("age", 5.0)
    captions = {call.args[0]: call.args[1] for call in window.shapes.set_caption.call_args_list}
    assert "outside the data" in captions[FULL_SHAPE]
    assert "outside the data" not in captions[TEMPLATE]


def test_one_drag_is_one_step_to_undo(ready, window):
    for value in (110.0, 120.0, 130.0):
        window.covariates.value_moved.emit("age", value)
    window.covariates.value_settled.emit("age", 130.0)
    window.show_history.assert_called_with(True, False)
    window.undo_requested.emit()
    assert dict(ready.state.named)["age"] == 100.0
    window.show_history.assert_called_with(False, True)
    window.redo_requested.emit()
    assert dict(ready.state.named)["age"] == 130.0


def test_covariates_that_move_together_are_one_step_to_undo(ready, window):
    """And the second stays where it was put, also where it would follow the first."""
    window.covariates.signals.follow_toggled.emit(True)
    for age, weight in ((110.0, 60.0), (120.0, 20.0)):
        window.covariates.values_moved.emit((("age", age), ("weight", weight)))
        assert ready.state.values == (age, weight, 0.0) and ready.is_moving
    window.covariates.values_settled.emit((("age", 120.0), ("weight", 20.0)))
    window.undo_requested.emit()
    assert ready.state.values == (100.0, 35.0, 0.0)
    window.show_history.assert_called_with(False, True)


def test_how_the_data_are_shown_is_no_step_to_undo(ready, window):
    window.covariates.support_requested.emit(Support("sex", "age", True))
    assert ready.state.support == Support("sex", "age", True)
    window.show_history.assert_called_with(False, False)


def test_undo_comes_before_a_movement_counts_as_at_rest(ready, window):
    window.covariates.value_settled.emit("age", 150.0)
    window.covariates.value_moved.emit("weight", 50.0)
    window.show_history.assert_called_with(True, False)
    window.undo_requested.emit()
    assert ready.state.values == (150.0, 35.0, 0.0) and not ready.is_moving
    window.redo_requested.emit()
    assert ready.state.values == (150.0, 50.0, 0.0)
    window.undo_requested.emit()
    window.undo_requested.emit()
    assert ready.state.values == (100.0, 35.0, 0.0)


def test_the_others_follow_while_one_is_dragged_and_come_back_with_it(ready, window):
    """The children of the stand-in gain 0.31 kg a month."""
    window.covariates.signals.follow_toggled.emit(True)
    ready.move("age", 130.0)
    ready.move("age", 160.0)
    assert dict(ready.state.named)["weight"] == pytest.approx(35 + 0.31 * 60, abs=1.5)
    ready.move("age", 100.0)
    ready.settle("age", 100.0)
    assert ready.state.values == pytest.approx((100.0, 35.0, 0.0))


def test_undo_shows_remembered_surfaces_without_computing(ready, window, atlas):
    window.covariates.value_settled.emit("age", 130.0)
    atlas.calls.clear()
    window.undo_requested.emit()
    assert atlas.calls == []
    assert ready.shown[AGE_ONLY].request.values == (("age", 100.0),)
    assert status(window).startswith("Exact")


def test_resets(ready, window):
    window.covariates.value_settled.emit("age", 130.0)
    window.covariates.value_settled.emit("sex", 1.0)
    window.covariates.reset_requested.emit("age")
    assert ready.state.values == (100.0, 35.0, 1.0)
    window.covariates.reset_all_requested.emit()
    assert ready.state.values == (100.0, 35.0, 0.0)


def test_the_full_shape_layout_computes_the_full_shape_only(ready, window, atlas):
    window.covariates.value_settled.emit("sex", 1.0)
    atlas.calls.clear()
    window.layout_requested.emit(Layout.FULL_SHAPE)
    window.covariates.value_settled.emit("age", 50.0)
    assert {what for what, _, _ in atlas.calls} == {"shape"}
    window.layout_requested.emit(Layout.SIDE_BY_SIDE)
    assert ready.shown[AGE_ONLY].request.values == (("age", 50.0),)


def test_a_file_that_is_no_atlas_is_explained_and_changes_nothing(ready, window, tmp_path):
    foreign = tmp_path / "letter.txt"
    foreign.write_text("Dear reader")
    before = ready.state
    window.open_requested.emit(foreign)
    assert "letter.txt is not an atlas file" in window.show_error.call_args.args[0]
    assert ready.state is before
    assert status(window).startswith("Exact")


def test_an_unexpected_error_is_told_in_words_and_work_goes_on_afterwards(ready, window, atlas, monkeypatch):
    monkeypatch.setattr(atlas, "_surface", Mock(side_effect=MemoryError("no room")))
    window.covariates.value_settled.emit("age", 50.0)
    assert "MemoryError: no room" in window.show_error.call_args.args[0]
    assert "Stopped by an error" in status(window)
    monkeypatch.undo()
    window.covariates.value_settled.emit("age", 60.0)
    assert ready.shown[AGE_ONLY].request.values == (("age", 60.0),)


def test_errors_in_words():
    assert in_words(InputError("covariate 'age' is 412")) == "Covariate 'age' is 412."
    assert in_words(InputError("a.stl is no mesh.")) == "a.stl is no mesh."
    assert "KeyError" in in_words(KeyError("x"))


def test_export_writes_what_is_asked_for_even_out_of_view(ready, window, tmp_path, card):
    window.layout_requested.emit(Layout.FULL_SHAPE)
    window.export_requested.emit(
        ExportChoice(panels_in(Layout.SIDE_BY_SIDE, card), "ply", 64, tmp_path / "new folder")
    )
    names = sorted(path.name for path in (tmp_path / "new folder").iterdir())
    values = ["age100", "weight35", "sex0"]
    views = ["template", "_".join(["full-shape", *values])]
    views += [f"{value.rstrip('0123456789')}-only_{value}" for value in values]
    assert names == sorted(f"ellipsoid-{view}.ply{ending}" for view in views for ending in ("", ".json"))
    assert "Exported 5 surfaces as PLY" in status(window)
    window.set_editable.assert_called_with(True)


def test_an_export_replaces_nothing_unasked(ready, window, tmp_path):
    choice = ExportChoice((FULL_SHAPE,), "stl", 64, tmp_path / "out")
    window.export_requested.emit(choice)
    window.ask.assert_not_called()
    (mesh,) = choice.folder.glob("*.stl")
    mesh.write_text("mine")
    window.ask.return_value = Answer(goes_on=False, is_last=True)
    window.export_requested.emit(choice)
    question, text, detail = window.ask.call_args.args
    assert question is REPLACE_FILES and "These 2 files are there already" in text
    assert detail == f"{mesh.name}\n{mesh.name}.json"
    assert mesh.read_text() == "mine"
    window.ask.return_value = Answer(goes_on=True)
    window.export_requested.emit(choice)
    assert mesh.stat().st_size > 1000 and window.ask.call_count == 2


def test_a_question_is_asked_until_it_is_answered_for_good(ready, window, tmp_path, settings):
    choice = ExportChoice((FULL_SHAPE,), "stl", 64, tmp_path / "out")
    window.export_requested.emit(choice)
    window.ask.return_value = Answer(goes_on=True, is_last=True)
    window.export_requested.emit(choice)
    window.export_requested.emit(choice)
    assert window.ask.call_count == 1
    again = Preferences(QSettings(settings.fileName(), QSettings.Format.IniFormat))
    settings.sync()
    assert not again.asks(REPLACE_FILES) and again.asks(CLOSE_WINDOW)
    window.ask_preferences.return_value = None
    window.preferences_requested.emit()
    assert not again.asks(REPLACE_FILES)
    window.ask_preferences.return_value = {REPLACE_FILES: True}
    window.preferences_requested.emit()
    assert window.ask_preferences.call_args.args[0] == {
        OPEN_ATLAS: True, CLOSE_WINDOW: True, REPLACE_FILES: False,
    }  # fmt: skip
    window.export_requested.emit(choice)
    assert window.ask.call_count == 2


def test_where_nobody_sits_nothing_is_asked_and_nothing_replaced(
    window, engine, settings, atlas_file, tmp_path
):
    preferences = Preferences(settings)
    workers = Worker(synchronous=True), Worker(synchronous=True)
    controller = Controller(window, engine, *workers, preferences, is_attended=False)
    controller.open(atlas_file)
    choice = ExportChoice((FULL_SHAPE,), "stl", 64, tmp_path / "out")
    controller.export(choice)
    (mesh,) = choice.folder.glob("*.stl")
    mesh.write_text("mine")
    controller.export(choice)
    assert mesh.read_text() == "mine" and "there already" in window.show_error.call_args.args[0]
    controller.export(choice, replaces=True)
    assert mesh.stat().st_size > 1000
    window.ask.assert_not_called()


def test_export_into_an_impossible_folder_is_explained(ready, window, tmp_path):
    (tmp_path / "file").write_text("in the way")
    window.export_requested.emit(ExportChoice((FULL_SHAPE,), "stl", 64, tmp_path / "file"))
    assert "choose another folder" in window.show_error.call_args.args[0]
    window.set_editable.assert_called_with(True)


def test_a_screenshot_is_written_whole(ready, window, tmp_path):
    image = QImage(30, 20, QImage.Format.Format_RGB32)
    image.fill(0x336699)
    window.grab_image.return_value = image
    window.screenshot_requested.emit(tmp_path / "picture.png")
    assert QImage(str(tmp_path / "picture.png")).size() == image.size()
    assert [path.name for path in tmp_path.glob(".picture*")] == []
    window.ask.return_value = Answer(goes_on=False)
    (tmp_path / "picture.png").write_text("mine")
    window.screenshot_requested.emit(tmp_path / "picture.png")
    assert "there already" in window.ask.call_args.args[1]
    assert (tmp_path / "picture.png").read_text() == "mine"
    window.screenshot_requested.emit(tmp_path / "picture.nonsense")
    assert "end its name with .png" in window.show_error.call_args.args[0]


def test_recent_files_and_theme_are_remembered(
    ready, window, engine, settings: QSettings, atlas_file, tmp_path
):
    window.show_recent.assert_called_with([atlas_file])
    window.theme_requested.emit(ThemeChoice.DARK)
    settings.sync()
    again = QSettings(settings.fileName(), QSettings.Format.IniFormat)
    Controller(window, engine, Worker(synchronous=True), Worker(synchronous=True), Preferences(again))
    window.show_recent.assert_called_with([atlas_file])
    window.show_theme.assert_called_with(ThemeChoice.DARK)


class HeldWorker(QObject):
    """A worker whose one job runs when the test says so."""

    progressed = Signal(float)
    failed = Signal(object)
    idle = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.job: Callable | None = None
        self.then: Callable | None = None
        self.cancelled = 0

    def submit(self, job: Callable, then: Callable) -> None:
        self.job, self.then = job, then

    def cancel(self) -> None:
        self.job = None
        self.cancelled += 1

    def close(self) -> None: ...

    def run(self) -> None:
        job, self.job = self.job, None
        if job is not None:
            job(self.then, Progress(self.progressed.emit))
        self.idle.emit()


@pytest.fixture
def held(window, engine, settings, card) -> tuple[Controller, HeldWorker]:
    worker = HeldWorker()
    controller = Controller(window, engine, worker, HeldWorker(), Preferences(settings))  # type: ignore[arg-type]
    controller.show_atlas(card)
    while worker.job is not None:
        worker.run()
    worker.cancelled = 0
    return controller, worker


def test_a_preview_under_way_is_not_cut_off_by_the_next_position(held, window, atlas):
    _, worker = held
    atlas.calls.clear()
    for value in range(101, 150):
        window.covariates.value_moved.emit("age", float(value))
    assert worker.cancelled == 0
    worker.run()
    assert [values["age"] for what, values, _ in atlas.calls if what == "age"] == [149.0]


def test_an_exact_surface_under_way_makes_room_for_the_slider(held, window):
    controller, worker = held
    window.covariates.value_settled.emit("age", 120.0)
    worker.run()  # the preview; the exact surfaces wait now
    assert "refining" in status(window)
    window.covariates.value_moved.emit("age", 121.0)
    assert worker.cancelled == 1
    worker.run()
    assert controller.shown[AGE_ONLY].request.values == (("age", 121.0),)


def test_a_result_for_values_left_behind_is_not_shown_at_rest(held, window, engine):
    controller, worker = held
    window.covariates.value_moved.emit("age", 120.0)
    late = engine.surface(request_for(controller.state, AGE_ONLY, PREVIEW_RESOLUTION))
    window.covariates.value_settled.emit("age", 90.0)
    worker.then((late,))
    assert controller.shown[AGE_ONLY].request.values != (("age", 120.0),)
    while worker.job is not None:
        worker.run()
    assert controller.shown[AGE_ONLY].request.values == (("age", 90.0),)
    assert controller.shown[AGE_ONLY].is_exact


def test_cancelling_keeps_the_preview_until_the_next_change(held, window):
    controller, worker = held
    window.covariates.value_settled.emit("age", 120.0)
    worker.run()
    window.cancel_requested.emit()
    worker.run()
    assert worker.job is None
    assert "Stopped" in status(window)
    assert not controller.shown[AGE_ONLY].is_exact
    window.covariates.value_settled.emit("age", 121.0)
    assert worker.job is not None


def test_the_progress_bar_appears_only_when_work_takes_long(held, window, qtbot):
    _, worker = held
    window.show_progress.reset_mock()
    window.covariates.value_settled.emit("age", 120.0)
    worker.run()
    worker.progressed.emit(0.25)
    assert all(call.args == (None,) for call in window.show_progress.call_args_list)
    qtbot.waitUntil(lambda: window.show_progress.call_args.args == (0.0,), timeout=30_000)
    worker.progressed.emit(0.5)
    window.show_progress.assert_called_with(0.5)
    worker.run()
    window.show_progress.assert_called_with(None)


def test_about_names_the_version(ready, window):
    window.about_requested.emit()
    window.show_about.assert_called_once_with(__version__)


def test_nothing_is_computed_after_closing(ready, window, atlas):
    window.closing.emit()
    ready.move("age", 50.0)
    assert atlas.calls == []
