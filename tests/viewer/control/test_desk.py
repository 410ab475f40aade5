"""Patients in the whole window: files on disk, mouse and keyboard, an atlas that was really trained."""

from __future__ import annotations

import gc
import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
import trimesh
from eggs import egg, label_volume, turned
from PySide6.QtCore import QMimeData, QPoint, QPointF, Qt, QTimer, QUrl
from PySide6.QtGui import QAction, QDropEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QFileDialog, QMessageBox, QWidget

from naisr_viewer.engine.engine import Engine
from naisr_viewer.panels.kinds import visible_panels
from naisr_viewer.program.start import make_window
from naisr_viewer.state.history import UNDO_DEPTH
from naisr_viewer.state.layouts import FULL_SHAPE, TEMPLATE, Layout, Panel
from naisr_viewer.state.patients import Reading
from naisr_viewer.state.questions import Answer
from naisr_viewer.state.requests import ExportChoice
from naisr_viewer.views import main_window
from naisr_viewer.words.numbers import gained, volume

BEFORE = Panel("before")
UNCERTAINTY = Panel("uncertainty")
CHANGE = Panel("change")
SCAN = Panel("scan")

CUBIC_CM = egg(6.0, 1.0).volume / 1000


@pytest.fixture(scope="module")
def engine(egg_cache) -> Engine:
    return Engine(folder=egg_cache)


@pytest.fixture
def ready(qtbot, engine, egg_atlas, tmp_path):
    """A window on the atlas of the eggs."""
    window, controller = make_window(engine, tmp_path / "settings.ini")
    window.resize(1280, 800)
    with qtbot.waitExposed(window):
        window.show()
    controller.open(egg_atlas)
    settle(qtbot, controller)
    yield window, controller
    window.close()
    window.deleteLater()
    qtbot.wait(0)
    gc.collect()


def settle(qtbot, controller) -> None:
    qtbot.waitUntil(lambda: not controller.is_busy, timeout=60_000)


@pytest.fixture
def scan_file(tmp_path) -> Path:
    path = tmp_path / "p01.stl"
    egg(6.0, 1.0).export(path)
    return path


def drop(window: QWidget, path: Path) -> None:
    mime = QMimeData()
    mime.setUrls([QUrl.fromLocalFile(str(path))])
    event = QDropEvent(
        QPointF(400, 300),
        Qt.DropAction.CopyAction,
        mime,
        Qt.MouseButton.LeftButton,
        Qt.KeyboardModifier.NoModifier,
    )
    window.dropEvent(event)


def click(button) -> None:
    QTest.mouseClick(button, Qt.MouseButton.LeftButton)


def type_known(window, name: str, text: str) -> None:
    """A number typed into the field of a covariate."""
    field = window.patients.known.rows[name].field
    field.setFocus()
    field.selectAll()
    QTest.keyClicks(field, text)
    QTest.keyClick(field, Qt.Key.Key_Return)


def action(window, text: str) -> QAction:
    (found,) = [each for each in window.findChildren(QAction) if each.text() == text]
    return found


@pytest.fixture
def fitted(ready, qtbot, scan_file):
    window, controller = ready
    drop(window, scan_file)
    settle(qtbot, controller)
    type_known(window, "age", "6")
    click(window.patients.known.rows["sex"].field.buttons[1])
    click(window.patients.known.fit)
    assert controller.is_busy
    settle(qtbot, controller)
    assert not window.error_text.text()
    return window, controller


def test_a_dropped_scan_is_shown_and_waits_to_be_fitted(ready, qtbot, scan_file):
    window, controller = ready
    assert not window.patients.isVisible() and not action(window, "Fit").isEnabled()
    drop(window, scan_file)
    settle(qtbot, controller)
    state = controller.state
    assert window.patients.isVisible() and state.shown.name == "p01.stl"
    assert state.shown.scan.extent == pytest.approx(CUBIC_CM, rel=1e-6)
    assert state.fit is None and state.person == 0 and window.patients.known.fit.isEnabled()


def test_the_file_menu_opens_a_scan(ready, qtbot, scan_file, monkeypatch):
    window, controller = ready
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *args, **more: (str(scan_file), ""))
    action(window, "Open scan…").trigger()
    settle(qtbot, controller)
    assert [each.name for each in controller.state.patients] == ["p01.stl"]


def test_a_fit_ends_at_the_patient_with_an_interval(fitted):
    window, controller = fitted
    state = controller.state
    assert dict(state.fit.values) == {"age": 6.0, "sex": 1.0}
    assert state.layout is Layout.FIT and action(window, "Fit").isChecked()
    assert state.fit.extent == pytest.approx(CUBIC_CM, rel=0.03)
    assert state.fit.residual_mm < 0.5
    assert volume(state.fit.extent, state.fit.extent_margin) in window.shapes.caption(FULL_SHAPE)
    assert controller.shown[SCAN].colouring is not None
    assert controller.shown[UNCERTAINTY].colouring is not None
    assert f"residual {state.fit.residual_mm:.2f} mm" in window.shapes.caption(SCAN)


def test_what_was_not_given_is_inferred(ready, qtbot, scan_file):
    window, controller = ready
    drop(window, scan_file)
    settle(qtbot, controller)
    click(window.patients.known.fit)
    settle(qtbot, controller)
    ((age, low, high), _sex) = controller.state.fit.intervals
    assert age == "age" and low < 6 < high


def test_years_ahead_before_and_after(fitted, qtbot):
    window, controller = fitted
    action(window, "Before and after").trigger()
    settle(qtbot, controller)
    box = window.covariates.rows["age"].box
    box.setFocus()
    box.selectAll()
    QTest.keyClicks(box, "8.5")
    QTest.keyClick(box, Qt.Key.Key_Return)
    qtbot.waitUntil(lambda: not controller.is_moving and not controller.is_busy, timeout=60_000)
    assert set(controller.shown) >= {BEFORE, FULL_SHAPE, CHANGE}
    before, after, change = (controller.shown[panel] for panel in (BEFORE, FULL_SHAPE, CHANGE))
    gain = (egg(8.5, 1.0).volume - egg(6.0, 1.0).volume) / 1000
    assert after.extent - before.extent == pytest.approx(gain, rel=0.2)
    assert change.colouring.values.max() == pytest.approx(5, abs=1.2)  # 2 mm a year at the poles
    assert gained(change.extent, change.extent_before, change.extent_margin) in (
        window.shapes.caption(CHANGE)
    )
    click(window.covariates.reset_all)
    settle(qtbot, controller)
    assert dict(controller.state.named)["age"] == 6.0


def test_dragging_follows_with_the_patients_own_code(fitted, qtbot, engine, egg_atlas):
    _, controller = fitted
    person = controller.state.person
    qtbot.waitUntil(lambda: engine.has_previews(egg_atlas, person), timeout=60_000)
    controller.set_layout(Layout.CHANGE)
    settle(qtbot, controller)
    controller.move("age", 7.5)
    settle(qtbot, controller)
    change = controller.shown[CHANGE]
    assert not change.is_exact and change.request.person == person
    assert change.colouring.values.max() == pytest.approx(3, abs=1)
    controller.settle("age", 7.5)
    settle(qtbot, controller)
    assert controller.shown[CHANGE].is_exact


def test_a_patient_is_never_taken_for_the_population(fitted, qtbot):
    window, controller = fitted
    mine = controller.shown[FULL_SHAPE].points_mm
    window.patients.patient_chosen.emit(None)
    settle(qtbot, controller)
    assert controller.state.layout is Layout.SIDE_BY_SIDE and controller.state.person == 0
    assert "±" not in window.shapes.caption(FULL_SHAPE)
    window.patients.patient_chosen.emit(controller.state.patients[0].key)
    settle(qtbot, controller)
    assert controller.shown[FULL_SHAPE].request.person > 0
    np.testing.assert_array_equal(controller.shown[FULL_SHAPE].points_mm, mine)


def test_a_simulated_surgery(fitted, qtbot, scan_file):
    """Another program lengthens the shape in place; both versions stay open and are compared."""
    window, controller = fitted
    longer = egg(8.5, 1.0)
    other = scan_file.with_suffix(".new.stl")
    longer.export(other)
    os.replace(other, scan_file)
    qtbot.waitUntil(lambda: controller.state.shown.is_changed, timeout=30_000)
    window.patients.reread_requested.emit()
    settle(qtbot, controller)
    old, new = controller.state.patients
    assert (old.name, new.name) == ("p01.stl", "p01.stl (2)") and old.fit is not None
    assert dict(window.patients.known.given()) == {"age": 6.0, "sex": 1.0}
    assert new.scan.extent == pytest.approx(longer.volume / 1000, rel=1e-6) and not new.is_changed
    check = window.patients.known.rows["age"].check
    QTest.mouseClick(check, Qt.MouseButton.LeftButton, pos=QPoint(8, check.height() // 2))
    assert dict(window.patients.known.given()) == {"sex": 1.0}  # nobody of a known age can be lengthened
    click(window.patients.known.fit)
    settle(qtbot, controller)
    window.patients.compared_chosen.emit(old.key)
    controller.set_layout(Layout.CHANGE)
    settle(qtbot, controller)
    change = controller.shown[CHANGE]
    assert change.extent_before == pytest.approx(old.fit.extent)
    gain = longer.volume / 1000 - CUBIC_CM
    assert change.extent - change.extent_before == pytest.approx(gain, rel=0.25)


def test_a_stopped_fit_changes_nothing(ready, qtbot, scan_file):
    window, controller = ready
    drop(window, scan_file)
    settle(qtbot, controller)
    click(window.patients.known.fit)
    controller.refinement.cancel()
    settle(qtbot, controller)
    assert controller.state.fit is None and "Cancelled" in window.status.text()
    assert window.patients.known.fit.isEnabled() and not window.error_text.text()


def test_a_file_that_cannot_be_read_loses_nothing(fitted, qtbot, tmp_path):
    window, controller = fitted
    before = controller.state
    bad = tmp_path / "notes.docx"
    bad.write_text("not a shape")
    drop(window, bad)
    settle(qtbot, controller)
    assert "notes.docx" in window.error_text.text() and controller.state == before


def test_a_scan_far_away_is_shown_blocked_until_it_is_aligned(ready, qtbot, tmp_path):
    window, controller = ready
    path = tmp_path / "far.stl"
    mesh = egg(6.0, 1.0)
    mesh.apply_translation([300, 0, 0])
    mesh.export(path)
    drop(window, path)
    settle(qtbot, controller)
    assert not window.patients.known.fit.isEnabled()
    type_known(window, "age", "6")
    box = window.patients.alignment.method
    box.setFocus()
    QTest.keyClick(box, Qt.Key.Key_Down)  # rigid
    settle(qtbot, controller)
    scan = controller.state.shown.scan
    assert "icp" in scan.alignment and window.patients.known.fit.isEnabled()
    assert np.abs(scan.points_mm.mean(axis=0)).max() < 5
    assert dict(window.patients.known.given()) == {"age": 6.0}  # what was typed stays


def test_a_scan_astray_is_aligned_first_or_its_fit_is_told_not_valid(ready, qtbot, tmp_path):
    window, controller = ready
    path = tmp_path / "astray.stl"
    egg(6.0, 1.0).apply_transform(turned(0, [12.0, 0, 0])).export(path)
    drop(window, path)
    settle(qtbot, controller)
    panel = window.patients
    assert panel.known.align.isVisible() and panel.known.fit.isEnabled()
    click(panel.known.fit)  # against the advice
    settle(qtbot, controller)
    before = controller.state
    assert not before.fit.is_valid and before.layout is Layout.FIT
    assert not action(window, "Before and after").isEnabled() and action(window, "Fit").isChecked()
    assert not panel.compare.isVisible()
    for view in (FULL_SHAPE, UNCERTAINTY):
        assert "not valid" in window.shapes.caption(view) and "±" not in window.shapes.caption(view)
    click(panel.known.align)
    QTest.keyClick(panel.alignment.method.view(), Qt.Key.Key_Down)  # rigid
    QTest.keyClick(panel.alignment.method.view(), Qt.Key.Key_Return)
    settle(qtbot, controller)
    lay = controller.state.shown.scan
    assert not panel.known.align.isVisible()
    click(panel.known.fit)
    settle(qtbot, controller)
    state = controller.state
    assert state.fit.is_valid and action(window, "Before and after").isEnabled()
    assert state.shown.scan is not lay and "onto its own fit" in panel.alignment.sentence.text()
    assert np.abs(state.shown.scan.points_mm.mean(axis=0)).max() < 1.0
    assert state.fit.extent == pytest.approx(CUBIC_CM, rel=0.03)
    undo(window, qtbot, controller)
    assert controller.state.shown.scan is lay and controller.state.fit is None
    undo(window, qtbot, controller)
    assert controller.state == replace(before, has_norms=True)  # what was learned is not forgotten


def test_nobody_is_compared_with_whose_fit_missed(fitted, qtbot, tmp_path):
    window, controller = fitted
    good = controller.state
    trimesh.creation.icosphere(3, 12.0).export(tmp_path / "ball.stl")
    drop(window, tmp_path / "ball.stl")
    settle(qtbot, controller)
    controller.set_layout(Layout.FULL_SHAPE)
    click(window.patients.known.fit)
    settle(qtbot, controller)
    ball = controller.state
    assert not ball.fit.is_valid
    controller.export(ExportChoice((FULL_SHAPE,), "stl", 64, tmp_path / "out"))
    settle(qtbot, controller)
    (record,) = (json.loads(path.read_text()) for path in (tmp_path / "out").glob("*.json"))
    assert record["patient"]["is_valid"] is False and record["volume_95_percent_margin_cm3"] is None
    window.patients.patient_chosen.emit(good.patient)
    settle(qtbot, controller)
    box = window.patients.compare.box
    average = "average at the same covariates"
    assert [box.itemText(i) for i in range(box.count())] == [average, "this patient as fitted", "ball.stl"]
    box.setFocus()
    QTest.keyClick(box, Qt.Key.Key_Down)
    assert box.currentData() is None and controller.state.compared is None
    controller.set_layout(Layout.CHANGE)
    window.patients.patient_chosen.emit(ball.patient)
    settle(qtbot, controller)
    assert controller.state.layout is Layout.FIT


def test_a_label_is_chosen(ready, qtbot, tmp_path, monkeypatch):
    window, controller = ready
    index = np.stack(np.meshgrid(*[np.arange(48)] * 3, indexing="ij"), axis=-1) - 24
    voxels = np.zeros((48, 48, 48), np.uint8)
    voxels[np.linalg.norm(index / [18, 17, 22], axis=-1) < 1] = 2
    voxels[:3] = 1
    header = (
        "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 48 48 48\nspace: left-posterior-superior\n"
        "space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (-24,-24,-24)\n"
        "encoding: raw\n\n"
    )
    path = tmp_path / "two.nrrd"
    path.write_bytes(header.encode() + voxels.tobytes(order="F"))
    asked = []

    def choose(_parent, labels):
        asked.append([number for number, _ in labels.titles])
        return 2

    monkeypatch.setattr(main_window, "ask_label", choose)
    drop(window, path)
    settle(qtbot, controller)
    assert asked == [[1, 2]]
    truth = 4 / 3 * np.pi * 18 * 17 * 22 / 1000
    assert controller.state.shown.scan.extent == pytest.approx(truth, rel=0.05)
    window.reading_requested.emit(Reading(path, label="2"))
    settle(qtbot, controller)
    assert asked == [[1, 2]] and len(controller.state.patients) == 2
    assert controller.state.shown.scan.extent == pytest.approx(truth, rel=0.05)


def undo(window, qtbot, controller) -> None:
    """Ctrl+Z, heard by the window whatever has the focus."""
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    QTest.keyClick(window.focusWidget() or window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    settle(qtbot, controller)


def test_a_closed_patient_comes_back_with_its_fit_at_once(fitted, qtbot, engine):
    window, controller = fitted
    before, mine = controller.state, controller.shown[FULL_SHAPE].points_mm
    window.patients.list.setFocus()
    QTest.keyClick(window.patients.list, Qt.Key.Key_Delete)
    settle(qtbot, controller)
    assert controller.state.patients == () and controller.state.person == 0
    assert "Ctrl+Z" in window.status.text() and before.person in engine.persons
    undo(window, qtbot, controller)
    assert controller.state == before
    assert controller.shown[FULL_SHAPE].points_mm is mine  # remembered, not computed
    assert dict(window.patients.known.given()) == {"age": 6.0, "sex": 1.0}


def test_what_only_the_history_held_is_freed_when_that_forgets_it(fitted, qtbot, engine):
    window, controller = fitted
    person = controller.state.person
    window.patients.close_requested.emit(controller.state.patients[0].key)
    for step in range(UNDO_DEPTH):
        assert person in engine.persons
        controller.settle("age", 3.0 + step / 100)
    settle(qtbot, controller)
    assert engine.persons == frozenset()


def test_a_scan_read_differently_keeps_the_fit_within_reach(fitted, qtbot):
    window, controller = fitted
    before = controller.state
    box = window.patients.alignment.method
    box.setFocus()
    QTest.keyClick(box, Qt.Key.Key_Down)  # rigid
    settle(qtbot, controller)
    assert controller.state.shown.reading.align == "icp" and controller.state.fit is None
    undo(window, qtbot, controller)
    assert controller.state == before and window.patients.alignment.method.currentData() == "none"


def test_fits_readings_and_comparisons_are_undone_one_by_one(fitted, qtbot, engine):
    window, controller = fitted
    once = controller.state
    click(window.patients.known.fit)
    settle(qtbot, controller)
    twice = controller.state
    window.patients.reread_requested.emit()
    settle(qtbot, controller)
    window.patients.patient_chosen.emit(twice.patient)
    window.patients.compared_chosen.emit(controller.state.patients[1].key)
    settle(qtbot, controller)
    assert engine.persons == {once.person, twice.person}
    undo(window, qtbot, controller)
    assert controller.state.compared is None and len(controller.state.patients) == 2
    undo(window, qtbot, controller)
    assert controller.state == twice
    undo(window, qtbot, controller)
    assert controller.state == once
    undo(window, qtbot, controller)
    assert controller.state.fit is None and controller.state.shown.scan is once.shown.scan
    undo(window, qtbot, controller)
    assert controller.state.patients == () and not action(window, "Undo").isEnabled()
    for _ in range(3):
        action(window, "Redo").trigger()
    settle(qtbot, controller)
    assert controller.state == twice


def test_a_file_that_changed_meanwhile_is_told_of_after_an_undo(fitted, qtbot, scan_file):
    window, controller = fitted
    window.patients.close_requested.emit(controller.state.patients[0].key)
    settle(qtbot, controller)
    egg(7.0, 1.0).export(scan_file)
    undo(window, qtbot, controller)
    assert controller.state.shown.is_changed


@pytest.fixture
def attended(fitted):
    """The same with somebody who is asked."""
    window, controller = fitted
    controller.questions.is_attended = True
    yield window, controller
    controller.questions.is_attended = False


def answer(button: str, seen: list[str], *, is_last: bool = False) -> None:
    """Press a button of the question that comes next."""

    def press() -> None:
        dialog = QApplication.activeModalWidget()
        if not isinstance(dialog, QMessageBox):  # the file is still being read
            QTimer.singleShot(10, press)
            return
        seen.append(dialog.text())
        dialog.checkBox().setChecked(is_last)
        (wanted,) = [each for each in dialog.buttons() if each.text().replace("&", "") == button]
        click(wanted)

    QTimer.singleShot(0, press)


def test_another_atlas_takes_no_fits_with_it_unasked(attended, qtbot, egg_atlas, engine):
    window, controller = attended
    before, seen = controller.state, list[str]()
    answer("Cancel", seen)
    window.open_requested.emit(egg_atlas)
    settle(qtbot, controller)
    assert controller.state is before
    assert "1 patient, 1 fit." in seen[0] and "p01.stl" in seen[0]
    answer("Open", seen)
    window.open_requested.emit(egg_atlas)
    settle(qtbot, controller)
    assert controller.state.patients == () and engine.persons == frozenset()
    window.open_requested.emit(egg_atlas)  # nothing to lose, nothing asked
    settle(qtbot, controller)
    assert len(seen) == 2


def test_the_window_closes_with_patients_only_when_it_may(attended):
    window, _ = attended
    seen: list[str] = []
    answer("Cancel", seen)
    action(window, "Quit").trigger()
    assert window.isVisible() and window.shapes.is_ready and len(seen) == 1
    answer("Close", seen, is_last=True)
    window.close()
    assert not window.isVisible() and len(seen) == 2


def test_an_export_says_whose_shape_it_is(fitted, qtbot, tmp_path):
    _, controller = fitted
    controller.export(ExportChoice((FULL_SHAPE,), "stl", 64, tmp_path / "out"))
    settle(qtbot, controller)
    record = json.loads((tmp_path / "out" / "eggs-p01-full-shape_age6_sexM.stl.json").read_text())
    assert record["patient"]["known"] == {"age": 6.0, "sex": 1.0}
    mesh = trimesh.load_mesh(tmp_path / "out" / "eggs-p01-full-shape_age6_sexM.stl")
    assert mesh.volume / 1000 == pytest.approx(CUBIC_CM, rel=0.05)


@pytest.mark.parametrize("layout", [Layout.FIT, Layout.CHANGE])
def test_all_views_on_screen_are_exported_with_their_numbers(fitted, qtbot, tmp_path, layout):
    _, controller = fitted
    controller.set_layout(layout)
    controller.settle("age", 8.5)
    settle(qtbot, controller)
    shown = dict(controller.shown)
    panels = visible_panels(controller.state)
    controller.export(ExportChoice(panels, "vtp", 64, tmp_path / "out"))
    settle(qtbot, controller)
    files = {path.name: path for path in (tmp_path / "out").glob("*.vtp")}
    stems = {
        Layout.FIT: [
            f"{view}_age8.5" for view in ("full-shape", "scan", "uncertainty", "deviation", "unusual-places")
        ],
        Layout.CHANGE: ["before_age6", "full-shape_age8.5", "change_age8.5_sexM_since_age6"],
    }
    assert set(files) == {f"eggs-p01-{stem}_sexM.vtp" for stem in stems[layout]}
    for panel in panels:
        (path,) = [
            path for name, path in files.items() if f"-p01-{panel.kind.replace('shape', 'full')}" in name
        ]
        arrays, colouring = pv.read(path).point_data, shown[panel].colouring
        record = json.loads(path.with_name(f"{path.name}.json").read_text())
        assert record["patient"]["known"] == {"age": 6.0, "sex": 1.0}
        if colouring is not None:
            np.testing.assert_allclose(arrays[record["numbers"]["name"]], colouring.values)
            assert record["numbers"]["in_file"]


def test_an_export_that_cannot_hold_one_view_writes_none(ready, qtbot, tmp_path):
    window, controller = ready
    cloud = tmp_path / "p02.xyz"
    np.savetxt(cloud, egg(6.0, 1.0).sample(4000, seed=0))
    drop(window, cloud)
    settle(qtbot, controller)
    click(window.patients.known.fit)
    settle(qtbot, controller)
    controller.export(ExportChoice(visible_panels(controller.state), "stl", 64, tmp_path / "out"))
    settle(qtbot, controller)
    assert "cloud of points" in window.error_text.text() and not (tmp_path / "out").exists()


def test_a_value_the_atlas_never_saw_is_not_turned_into_another(ready, qtbot, scan_file):
    window, controller = ready
    drop(window, scan_file)
    settle(qtbot, controller)
    for typed in ("12", "0.2"):
        type_known(window, "age", typed)
        click(window.patients.known.fit)
        settle(qtbot, controller)
        assert f"Age is {typed} years" in window.error_text.text() and controller.state.fit is None
    type_known(window, "age", "9")  # the oldest there is
    click(window.patients.known.fit)
    settle(qtbot, controller)
    assert dict(controller.state.fit.values)["age"] == pytest.approx(9)


def test_a_movement_ends_with_its_patient(fitted, qtbot):
    window, controller = fitted
    box = window.covariates.rows["age"].box
    box.setFocus()
    box.selectAll()
    QTest.keyClicks(box, "8")
    QTest.keyClick(box, Qt.Key.Key_Return)
    window.patients.patient_chosen.emit(None)  # before the movement counts as at rest
    qtbot.wait(600)
    settle(qtbot, controller)
    assert controller.state.values == controller.state.home and not controller.is_moving
    undo(window, qtbot, controller)
    assert controller.state.person > 0 and dict(controller.state.named)["age"] == 6.0
    action(window, "Redo").trigger()
    settle(qtbot, controller)
    assert controller.state.person > 0 and dict(controller.state.named)["age"] == 8.0


def test_nothing_of_one_patient_stands_under_another(fitted, qtbot):
    window, controller = fitted
    controller.set_layout(Layout.SIDE_BY_SIDE)
    settle(qtbot, controller)
    window.patients.patient_chosen.emit(None)
    assert {result.request.person for result in controller.shown.values()} <= {0}
    assert "±" not in window.shapes.caption(FULL_SHAPE)
    settle(qtbot, controller)


def test_several_scans_that_are_dropped_are_all_read(ready, qtbot, tmp_path):
    window, controller = ready
    for number, age in enumerate((3.0, 5.0, 7.0)):
        egg(age, 1.0).export(tmp_path / f"v{number}.ply")
        drop(window, tmp_path / f"v{number}.ply")
    qtbot.waitUntil(lambda: len(controller.state.patients) == 3, timeout=60_000)
    settle(qtbot, controller)
    assert [each.name for each in controller.state.patients] == ["v0.ply", "v1.ply", "v2.ply"]


def test_of_several_files_every_one_that_cannot_be_read_is_told_of(ready, qtbot, tmp_path):
    window, controller = ready
    egg(5.0, 1.0).export(tmp_path / "good.ply")
    for name in ("first.docx", "last.docx"):
        (tmp_path / name).write_text("a letter")
    for name in ("first.docx", "good.ply", "last.docx"):
        drop(window, tmp_path / name)
    qtbot.waitUntil(lambda: len(controller.state.patients) == 1, timeout=60_000)
    settle(qtbot, controller)
    told = window.error_text.text().replace("\u200b", "")
    assert "first.docx" in told and "last.docx" in told
    drop(window, tmp_path / "good.ply")  # another act
    settle(qtbot, controller)
    assert not window.error_text.text()


def test_what_would_end_a_fit_rests_meanwhile(ready, qtbot, scan_file):
    window, controller = ready
    drop(window, scan_file)
    settle(qtbot, controller)
    click(window.patients.known.fit)
    for text in ("Open scan…", "Export…", "Reset all covariates", "Undo"):
        assert not action(window, text).isEnabled()
    settle(qtbot, controller)
    assert action(window, "Open scan…").isEnabled() and controller.state.fit is not None


def test_a_file_that_is_deleted_and_written_anew_has_changed(ready, qtbot, scan_file):
    window, controller = ready
    drop(window, scan_file)
    settle(qtbot, controller)
    scan_file.unlink()
    qtbot.wait(200)
    assert not controller.state.shown.is_changed
    egg(7.0, 1.0).export(scan_file)
    qtbot.waitUntil(lambda: controller.state.shown.is_changed, timeout=30_000)


def test_exports_of_two_versions_of_a_file_do_not_meet(fitted, qtbot, tmp_path):
    window, controller = fitted
    window.patients.reread_requested.emit()
    settle(qtbot, controller)
    click(window.patients.known.fit)
    settle(qtbot, controller)
    for patient in controller.state.patients:
        window.patients.patient_chosen.emit(patient.key)
        settle(qtbot, controller)
        controller.export(ExportChoice((TEMPLATE, FULL_SHAPE), "stl", 64, tmp_path / "out"), replaces=True)
        settle(qtbot, controller)
    names = {path.name for path in (tmp_path / "out").glob("*.stl")}
    full_shape = "full-shape_age6_sexM.stl"
    assert names == {f"eggs-p01-{full_shape}", f"eggs-p01-2-{full_shape}", "eggs-template.stl"}
    assert json.loads((tmp_path / "out" / "eggs-template.stl.json").read_text())["patient"] is None


def test_a_file_is_judged_before_it_is_asked_what_may_be_lost(ready, qtbot, scan_file, tmp_path, monkeypatch):
    window, controller = ready
    asked: list[str] = []

    def decline(question, *_) -> Answer:
        asked.append(question.name)
        return Answer(goes_on=False)

    controller.questions.is_attended = True
    monkeypatch.setattr(window, "ask", decline)
    drop(window, scan_file)
    settle(qtbot, controller)
    before = controller.state
    for name in ("broken.safetensors", "broken.json"):
        (tmp_path / name).write_bytes(b"nothing of the kind")
        drop(window, tmp_path / name)
        settle(qtbot, controller)
        assert name in window.error_text.text()
    assert asked == []
    good = Path(shutil.copy(before.atlas.path, tmp_path / "good.safetensors"))
    drop(window, good)
    settle(qtbot, controller)
    assert asked == ["open atlas"]  # and it was answered with no
    assert controller.state.atlas is before.atlas and controller.state.patients == before.patients
    controller.questions.is_attended = False  # so that the window may close


def test_another_label_of_an_open_volume_is_read(ready, qtbot, tmp_path, monkeypatch):
    window, controller = ready
    answers = iter((2, 1, None))
    monkeypatch.setattr(main_window, "ask_label", lambda *_: next(answers))
    drop(window, label_volume(tmp_path / "labels.nii"))
    settle(qtbot, controller)
    egg_cm3 = controller.state.shown.scan.extent
    for expected in (1, 1):  # another label; then nobody chooses
        QTest.mouseClick(window.patients.scan.relabel, Qt.MouseButton.LeftButton)
        settle(qtbot, controller)
        assert controller.state.shown.reading.label == expected
    assert controller.state.shown.scan.extent != egg_cm3
    window.undo_requested.emit()
    settle(qtbot, controller)
    assert controller.state.shown.reading.label == 2


def test_why_a_number_is_not_taken_stands_in_the_status_line(ready, qtbot):
    window, controller = ready
    box = window.covariates.rows["age"].box
    QTest.mouseClick(box, Qt.MouseButton.LeftButton)
    box.selectAll()
    QTest.keyClicks(box, "412")
    QTest.keyClick(box, Qt.Key.Key_Return)
    assert "“412” is outside the data behind the atlas" in window.status.text()
    assert dict(controller.state.named)["age"] != 412


def test_a_session_that_is_cancelled_takes_nothing_away(ready, qtbot, scan_file, tmp_path):
    window, controller = ready
    drop(window, scan_file)
    settle(qtbot, controller)
    window.patients.known.fit.click()
    settle(qtbot, controller)
    window.session_place_chosen.emit(tmp_path / "s.json")
    settle(qtbot, controller)
    before = controller.state
    window.session_requested.emit(tmp_path / "s.json")
    window.cancel_requested.emit()
    settle(qtbot, controller)
    assert controller.state.patients == before.patients
    window.covariates.value_settled.emit("age", 3.0)
    settle(qtbot, controller)
    assert controller.shown[FULL_SHAPE].request.person == before.person  # who is still known


@pytest.fixture
def three(ready, qtbot, tmp_path):
    """Three scans that are open, with a table of what is known of two of them."""
    window, controller = ready
    for number, (age, sex) in enumerate([(6.0, 1.0), (3.0, -1.0), (5.0, 1.0)], start=1):
        egg(age, sex).export(tmp_path / f"p{number}.stl")
        drop(window, tmp_path / f"p{number}.stl")
        settle(qtbot, controller)
    table = tmp_path / "known.csv"
    table.write_text("mesh,subject,age [years],sex\np1.stl,A,6,M\np2.stl,B,3,\np3.stl,C,old,M\n")
    return window, controller, table


def test_all_scans_are_fitted_with_what_a_table_says_is_known(three, qtbot, monkeypatch):
    window, controller, table = three
    together = window.patients.together
    assert together.isVisible() and together.fit.isEnabled()
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *args, **more: (str(table), ""))
    click(together.known)
    settle(qtbot, controller)
    assert [dict(each.known) for each in controller.state.patients] == [
        {"age": 6.0, "sex": 1.0},
        {"age": 3.0},
        {},
    ]
    told = (
        "known.csv: the row of p3.stl cannot be used: covariate 'age' is 'old'; expected a number in years."
    )
    assert window.error_text.text() == told
    assert "Known of 2 of 3 scans by known.csv" in window.status.text()
    type_known(window, "age", "5")  # of p3.stl, which is shown
    shown = controller.state.patient
    click(together.fit)
    settle(qtbot, controller)
    first, second, third = controller.state.patients
    assert controller.state.patient == shown == third.key and not window.error_text.text()
    assert dict(first.fit.values) == {"age": 6.0, "sex": 1.0} and not first.fit.intervals
    assert [name for name, _, _ in second.fit.intervals] == ["sex"] and dict(second.fit.values)["sex"] == -1.0
    assert dict(third.known) == {"age": 5.0}
    for each, (age, sex) in zip((first, second, third), [(6.0, 1.0), (3.0, -1.0), (5.0, 1.0)], strict=True):
        assert each.fit.extent == pytest.approx(egg(age, sex).volume / 1000, rel=0.05)
    assert not together.fit.isEnabled()


def test_what_was_fitted_stays_when_fitting_all_is_cancelled(three, qtbot):
    window, controller, _ = three
    click(window.patients.together.fit)
    qtbot.waitUntil(lambda: any(each.fit for each in controller.state.patients), timeout=60_000)
    controller.refinement.cancel()
    settle(qtbot, controller)
    fits = [each.fit is not None for each in controller.state.patients]
    assert fits[0] and not fits[2]
    assert window.patients.together.fit.isEnabled()


def test_a_value_out_of_range_is_told_with_its_scan_before_anything_is_fitted(three, qtbot):
    window, controller, _ = three
    type_known(window, "age", "99")
    click(window.patients.together.fit)
    settle(qtbot, controller)
    assert window.error_text.text().startswith(
        "p3.stl: Age is 99 years; the atlas was made from 1 to 9 years."
    )
    assert not any(each.fit for each in controller.state.patients)
