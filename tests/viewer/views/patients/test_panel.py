"""Scans, known covariates and results on the right side, alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QFileDialog, QLabel, QScrollArea, QToolButton, QWidget
from pytestqt.qtbot import QtBot

from naisr_viewer.state.explorer import (
    AVERAGE_KEY,
    ExplorerState,
    opened,
    showing,
    with_patient,
    without_patient,
)
from naisr_viewer.state.patients import Fitted, OpenScan, Reading, Scan
from naisr_viewer.views.patients import panel as pp
from naisr_viewer.views.patients.known import NumberField
from naisr_viewer.views.patients.list import AVERAGE
from naisr_viewer.views.patients.pieces import ChoiceBox
from naisr_viewer.words.patients import UNITS

LEFT = Qt.MouseButton.LeftButton


def scan(**facts) -> Scan:
    corners = np.zeros((3, 3), np.float32)
    return Scan(
        corners, corners, np.array([[0, 1, 2]]), facts.pop("source", "p01.stl, 12,034 faces"), **facts
    )


FIT = Fitted(
    person=1,
    values=(("age", 84.0), ("weight", 21.43), ("sex", 1.0)),
    intervals=(("weight", 18.23, 24.91), ("sex", -1.0, 1.0)),
    extent=48.31,
    extent_margin=2.13,
    residual_mm=0.312,
    lasting=0.36,
    seconds=2.31,
    remarks=("the shape does not tell sex: both levels explain it",),
)
ONE = OpenScan(1, "p01.stl", Reading(Path("/scans/p01.stl")), scan(extent=46.21))
TWO = OpenScan(2, "p02.ply", Reading(Path("/scans/p02.ply")), scan(source="p02.ply, 800 faces"))


@pytest.fixture
def start(card) -> ExplorerState:
    return opened(ExplorerState(), card)


@pytest.fixture
def panel(qtbot: QtBot, start) -> pp.PatientPanel:
    panel = pp.PatientPanel()
    qtbot.addWidget(panel)
    panel.show_state(start)
    panel.resize(pp.PANEL_WIDTH, 1300)
    with qtbot.waitExposed(panel):
        panel.show()
    panel.activateWindow()
    qtbot.waitUntil(panel.isActiveWindow)  # only then a click gives a field the focus
    return panel


@pytest.fixture
def heard(panel) -> list[tuple]:
    acts: list[tuple] = []
    for name in (
        "open_requested",
        "patient_chosen",
        "close_requested",
        "reread_requested",
        "reading_changed",
        "fit_requested",
        "compared_chosen",
        "ghost_toggled",
    ):
        getattr(panel, name).connect(lambda *said, name=name: acts.append((name, *said)))
    return acts


def words(widget: QWidget) -> str:
    """All that can be read."""
    texts = [each.text() for each in widget.findChildren(QLabel) if each.isVisible()]
    return "\n".join(texts).replace("\u200b", "")


def click(widget: QWidget) -> None:
    QTest.mouseClick(widget, LEFT)


def click_row(panel: pp.PatientPanel, row: int) -> None:
    where = panel.list.visualItemRect(panel.list.item(row)).center()
    QTest.mouseClick(panel.list.viewport(), LEFT, pos=where)


def choose(box: ChoiceBox, text: str) -> None:
    """Open a combo box and go to an entry with the keyboard."""
    box.setFocus()
    QTest.keyClick(box, Qt.Key.Key_Space)
    steps = box.findText(text) - box.currentIndex()
    for _ in range(abs(steps)):
        QTest.keyClick(box.view(), Qt.Key.Key_Down if steps > 0 else Qt.Key.Key_Up)
    QTest.keyClick(box.view(), Qt.Key.Key_Return)


def field(panel: pp.PatientPanel, name: str):
    return panel.known.rows[name].field


def write(box: NumberField, text: str) -> None:
    """Click into a field and type over what is there."""
    QTest.mouseClick(box, LEFT)
    box.selectAll()
    QTest.keyClicks(box, text)


# --- the list -----------------------------------------------------------------------------------


def test_without_patients_it_invites_to_open_one(panel, heard):
    assert "Open a scan to fit the atlas to it: a mesh, a label volume or a cloud of points." in words(panel)
    for part in (panel.list, panel.scan, panel.alignment, panel.known, panel.result, panel.compare):
        assert not part.isVisible()
    click(panel.open)
    assert heard == [("open_requested",)]


def test_without_an_atlas_nothing_can_be_opened(panel):
    panel.show_state(ExplorerState())
    assert not panel.open.isEnabled()


def test_the_list_names_everybody_and_chooses(panel, start, heard):
    state = with_patient(with_patient(start, replace(ONE, fit=FIT)), TWO)
    panel.show_state(state)
    for word in (AVERAGE, "p01.stl", "48.3 cm³", "p02.ply", "not fitted"):
        assert word in words(panel.list).split("\n")
    assert panel.list.currentRow() == 2
    assert heard == []
    click_row(panel, 1)
    click_row(panel, 0)
    QTest.keyClick(panel.list, Qt.Key.Key_Down)
    assert heard == [("patient_chosen", 1), ("patient_chosen", None), ("patient_chosen", 1)]


def test_patients_are_closed_by_button_and_key(panel, start, heard):
    panel.show_state(with_patient(with_patient(start, ONE), TWO))
    first, second = panel.list.findChildren(QToolButton)
    assert (first.accessibleName(), second.accessibleName()) == ("Close p01.stl", "Close p02.ply")
    click(first)
    panel.list.setFocus()
    QTest.keyClick(panel.list, Qt.Key.Key_Delete)
    assert heard == [("close_requested", 1), ("close_requested", 2)]
    panel.show_state(showing(with_patient(start, ONE), None))
    QTest.keyClick(panel.list, Qt.Key.Key_Delete)  # the average cannot be closed
    assert len(heard) == 2
    panel.show_state(without_patient(with_patient(start, ONE), 1))
    assert not panel.list.isVisible()


def test_the_list_grows_to_four_rows(panel, start):
    heights = []
    state = start
    for key in range(1, 7):
        state = with_patient(state, replace(ONE, key=key))
        panel.show_state(state)
        heights.append(panel.list.height())
    assert heights[0] < heights[1] < heights[2] == heights[3] == heights[5]
    assert panel.list.visualItemRect(panel.list.currentItem()).bottom() <= panel.list.viewport().height()


def test_a_narrow_list_keeps_its_buttons_in_sight(panel, start, qtbot):
    state = start
    for key in range(1, 7):
        state = with_patient(state, replace(ONE, key=key))
    panel.show_state(state)
    for width in (pp.PANEL_WIDTH, pp.LEAST_WIDTH, pp.PANEL_WIDTH):
        panel.resize(width, 600)
        qtbot.waitUntil(
            lambda: all(
                reaches_the_edge(each, panel.list.viewport()) for each in panel.list.findChildren(QToolButton)
            )
        )


def reaches_the_edge(close: QToolButton, sight: QWidget) -> bool:
    """Whether a button is in sight as a whole, at the right edge of its list."""
    return 0 <= sight.width() - close.mapTo(sight, QPoint(close.width(), 0)).x() <= 12


# --- the scan and where it lies -----------------------------------------------------------------


def test_the_scan_is_described_and_its_trouble_told(panel, start, heard):
    notes = ("the surface is open", "its numbers look like metres")
    trouble = "the shape lies 412 mm from the middle; align it to the atlas"
    panel.show_state(with_patient(start, replace(ONE, scan=scan(notes=notes, blocked=trouble))))
    said = words(panel.scan)
    for word in (
        "p01.stl, 12,034 faces",
        "open surface, no volume",
        "The surface is open",
        "Its numbers look",
    ):
        assert word in said
    assert panel.scan.blocked.text() == trouble.capitalize()
    assert not panel.known.fit.isEnabled()
    panel.show_state(with_patient(start, ONE))
    assert "encloses 46.2 cm³" in words(panel.scan)
    assert not panel.scan.blocked.isVisible()
    assert not panel.scan.notes.isVisible()
    assert panel.known.fit.isEnabled()
    assert heard == []


def test_a_changed_file_is_pointed_out_and_read_again(panel, start, heard):
    panel.show_state(with_patient(start, ONE))
    assert "changed on disk" not in words(panel)
    click(panel.scan.reread)
    panel.show_state(with_patient(start, replace(ONE, is_changed=True)))
    assert "changed on disk" in words(panel)
    assert not panel.scan.reread.isVisible()
    click(panel.scan.reread_changed)
    assert heard == [("reread_requested",)] * 2


def test_the_ghost_is_switched(panel, start, heard):
    panel.show_state(with_patient(start, ONE))
    assert panel.scan.ghost.isChecked()
    QTest.mouseClick(panel.scan.ghost, LEFT, pos=QPoint(8, panel.scan.ghost.height() // 2))
    panel.show_state(replace(with_patient(start, ONE), has_ghost=False))
    assert not panel.scan.ghost.isChecked()
    assert heard == [("ghost_toggled", False)]


def test_an_alignment_and_a_unit_are_asked_for(panel, start, heard):
    panel.show_state(with_patient(start, ONE))
    assert panel.alignment.hint.isVisible()
    choose(panel.alignment.method, "rigid (ICP)")
    choose(panel.alignment.unit, "m")
    assert heard == [
        ("reading_changed", replace(ONE.reading, align="icp")),
        ("reading_changed", replace(ONE.reading, scale=1000.0)),
    ]
    told = "aligned by icp; mean distance 6.31 mm before, 1.02 mm after"
    moved = replace(ONE, reading=replace(ONE.reading, align="icp"), scan=scan(alignment=told), fit=FIT)
    panel.show_state(with_patient(start, moved))
    assert panel.alignment.method.currentData() == "icp"
    assert panel.alignment.unit.currentText() == "guessed"
    assert told.capitalize() in words(panel.alignment)
    assert not panel.alignment.hint.isVisible()
    choose(panel.alignment.method, "rigid (ICP)")
    assert len(heard) == 2  # nothing new


def test_any_scale_is_shown(panel, start):
    panel.show_state(with_patient(start, replace(ONE, reading=replace(ONE.reading, scale=0.5))))
    assert panel.alignment.unit.currentText() == "0.5 mm"
    panel.show_state(with_patient(start, ONE))
    assert panel.alignment.unit.count() == len(UNITS)


def test_landmarks_need_a_file(panel, start, heard, monkeypatch):
    panel.show_state(with_patient(start, ONE))
    answers = ["", "/scans/p01.csv"]
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *_: (answers.pop(0), ""))
    choose(panel.alignment.method, "landmarks…")
    assert heard == []
    assert panel.alignment.method.currentData() == "none"
    choose(panel.alignment.method, "landmarks…")
    assert heard == [
        ("reading_changed", replace(ONE.reading, align="landmarks", landmarks=Path("/scans/p01.csv")))
    ]


# --- what is known ------------------------------------------------------------------------------


def test_nothing_is_known_at_first(panel, start, heard):
    panel.show_state(with_patient(start, ONE))
    for row in panel.known.rows.values():
        assert not row.check.isChecked()
    assert field(panel, "age").text() == ""
    assert field(panel, "age").placeholderText() == "infer"
    assert panel.known.rows["sex"].note.text() == "infer"
    click(panel.known.fit)
    assert heard == [("fit_requested", ())]


def test_what_is_typed_is_known(panel, start, heard):
    panel.show_state(with_patient(start, ONE))
    click(field(panel, "sex").buttons[1])
    write(field(panel, "weight"), "20.4")
    assert panel.known.rows["weight"].check.isChecked()
    assert not panel.known.rows["age"].check.isChecked()
    click(panel.known.fit)
    assert heard == [("fit_requested", (("weight", 20.4), ("sex", 1.0)))]
    field(panel, "weight").selectAll()
    QTest.keyClick(field(panel, "weight"), Qt.Key.Key_Backspace)
    assert not panel.known.rows["weight"].check.isChecked()
    assert panel.known.given() == (("sex", 1.0),)


def test_a_tick_proposes_the_mean_to_be_typed_over(panel, start, qtbot):
    panel.show_state(with_patient(start, ONE))
    row = panel.known.rows["age"]
    QTest.mouseClick(row.check, LEFT, pos=QPoint(8, row.check.height() // 2))
    qtbot.waitUntil(lambda: field(panel, "age").hasFocus())
    assert panel.known.given() == (("age", 100.0),)
    QTest.keyClicks(field(panel, "age"), "84")
    assert panel.known.given() == (("age", 84.0),)
    QTest.mouseClick(row.check, LEFT, pos=QPoint(8, row.check.height() // 2))
    assert panel.known.given() == ()
    assert field(panel, "age").text() == ""
    sex = panel.known.rows["sex"]
    QTest.mouseClick(sex.check, LEFT, pos=QPoint(8, sex.check.height() // 2))
    assert panel.known.given() == (("sex", -1.0),)
    assert sex.note.text() == ""


def test_escape_leaves_a_field_as_if_nothing_had_been_typed(panel, start):
    panel.show_state(with_patient(start, ONE))
    write(field(panel, "age"), "84.5")
    assert panel.known.rows["age"].check.isChecked()
    QTest.keyClick(field(panel, "age"), Qt.Key.Key_Escape)
    assert not panel.known.rows["age"].check.isChecked() and panel.known.given() == ()
    write(field(panel, "age"), "84.5")
    QTest.keyClick(field(panel, "age"), Qt.Key.Key_Return)
    write(field(panel, "age"), "9")
    QTest.keyClick(field(panel, "age"), Qt.Key.Key_Escape)
    QTest.keyClick(field(panel, "age"), Qt.Key.Key_Tab)
    assert panel.known.given() == (("age", 84.5),) and field(panel, "age").text() == "84.5"


def test_what_was_typed_comes_back_with_a_closed_patient(panel, start):
    opened_one = with_patient(start, ONE)
    panel.show_state(opened_one)
    write(field(panel, "age"), "84.5")
    panel.show_state(without_patient(opened_one, 1))
    panel.show_state(opened_one)
    assert panel.known.given() == (("age", 84.5),)


def test_arrow_keys_begin_at_the_mean(panel, start):
    panel.show_state(with_patient(start, ONE))
    age = field(panel, "age")
    age.setFocus()
    QTest.keyClick(age, Qt.Key.Key_Up)
    assert panel.known.given() == (("age", 100.0 + age.step),)


def test_a_value_is_told_as_it_was_typed_and_ends_of_the_range_as_they_are(panel, start, card):
    panel.show_state(with_patient(start, ONE))
    write(field(panel, "weight"), "950")
    QTest.keyClick(field(panel, "weight"), Qt.Key.Key_Return)
    assert dict(panel.known.given())["weight"] == 950.0
    assert "4 to 95 kg" in field(panel, "weight").toolTip()
    narrow = replace(card.covariates[0], range=(1.44, 220.44))
    number = NumberField(narrow, panel)
    number.give(220.44)
    assert number.given() == 220.44
    number.give(1.44)
    assert number.given() == 1.44  # the box says 1, which is outside


def test_typing_outlives_other_news(panel, start):
    state = with_patient(start, ONE)
    panel.show_state(state)
    write(field(panel, "age"), "84")
    panel.show_state(with_patient(replace(state, has_ghost=False), replace(ONE, is_changed=True)))
    assert field(panel, "age").text() == "84"
    assert field(panel, "age").hasFocus()
    panel.show_state(with_patient(state, TWO))
    assert panel.known.given() == ()
    click(field(panel, "sex").buttons[0])
    panel.show_state(showing(with_patient(state, TWO), 1))
    assert panel.known.given() == (("age", 84.0),)
    panel.show_state(with_patient(state, TWO))
    assert panel.known.given() == (("sex", -1.0),)


def test_what_a_fit_was_told_is_shown(panel, start):
    panel.show_state(with_patient(start, ONE))
    panel.show_state(with_patient(start, replace(ONE, known=(("age", 84.0), ("sex", 1.0)), fit=FIT)))
    assert panel.known.given() == (("age", 84.0), ("sex", 1.0))
    assert panel.known.fit.text() == "Fit again"


def test_beside_a_result_stands_what_its_fit_was_told(panel, start):
    first = with_patient(with_patient(start, TWO), replace(ONE, known=(("age", 84.0),), fit=FIT))
    second = with_patient(first, replace(ONE, known=(("age", 96.0),), fit=replace(FIT, person=2)))
    panel.show_state(first)
    panel.show_state(showing(first, 2))
    panel.show_state(first)
    panel.show_state(second)  # fitted again
    panel.show_state(first)  # undone
    panel.show_state(showing(first, 2))
    panel.show_state(second)  # and done again, from another patient
    assert panel.known.given() == (("age", 96.0),)
    panel.show_state(with_patient(first, replace(ONE, fit=FIT)))
    assert panel.known.given() == ()


def test_another_atlas_has_other_rows(panel, start, card):
    other = replace(card, covariates=card.covariates[:1])
    panel.show_state(opened(start, other))
    assert list(panel.known.rows) == ["age"]


def test_the_wheel_scrolls_and_changes_nothing_under_the_pointer(panel, start, heard, qtbot):
    panel.resize(pp.PANEL_WIDTH, 400)
    panel.show_state(with_patient(start, ONE))
    area = panel.findChild(QScrollArea)
    bar = area.verticalScrollBar()
    qtbot.waitUntil(lambda: bar.maximum() > 60)
    for widget in (panel.alignment.method, panel.alignment.unit, field(panel, "age")):
        area.ensureWidgetVisible(widget)
        before, middle = bar.value(), widget.mapTo(panel, widget.rect().center())
        assert panel.rect().contains(middle) and before < bar.maximum()
        QTest.wheelEvent(panel.windowHandle(), QPointF(middle), QPoint(0, -120))
        assert bar.value() > before
    assert heard == []
    assert panel.known.given() == ()


def test_the_tab_key_goes_from_top_to_bottom(panel, start, qtbot):
    other = replace(TWO, fit=FIT)
    panel.show_state(with_patient(with_patient(start, other), replace(ONE, fit=FIT)))
    panel.open.setFocus()
    qtbot.waitUntil(panel.open.hasFocus)
    seen = []
    for _ in range(15):
        QTest.keyClick(panel.window(), Qt.Key.Key_Tab)
        seen.append(QApplication.focusWidget())
    top = [panel.list, panel.together.known, panel.scan.reread, panel.scan.ghost]
    expected = [*top, panel.alignment.method, panel.alignment.unit]
    assert [each for each in seen if each in [*expected, *panel.known.stops(), panel.compare.box]] == [
        *expected,
        *panel.known.stops(),
        panel.compare.box,
    ]


# --- what was found -----------------------------------------------------------------------------


def test_the_result_tells_values_and_how_sure_they_are(panel, start):
    panel.show_state(with_patient(start, replace(ONE, fit=FIT)))
    said = words(panel.result).split("\n")
    for word in ("84 months", "known", "21.4 kg", "95\u00a0%: 18.2 to 24.9 kg", "M", "inferred; F or M"):
        assert word in said
    for word in ("48.3 ± 2.1 cm³ (95\u00a0%)", "0.31 mm", "2.3 s"):
        assert word in said
    assert "The shape does not tell sex: both levels explain it" in said
    panel.show_state(with_patient(start, replace(ONE, fit=replace(FIT, person=2, extent=50.0, remarks=()))))
    assert "50.0 ± 2.1 cm³ (95\u00a0%)" in words(panel.result)
    assert "does not tell" not in words(panel.result)


MISSED = replace(
    FIT,
    is_valid=False,
    residual_mm=9.51,
    remarks=("not valid: the fitted surface is 9.5 mm from the scan; align",),
)


def test_a_fit_that_missed_tells_neither_covariates_nor_volume(panel, start):
    panel.show_state(with_patient(start, replace(ONE, fit=MISSED)))
    said = words(panel.result)
    assert "Not valid: the fitted surface is 9.5 mm from the scan; align" in said and "9.51 mm" in said
    for word in ("cm³", "kg", "months", "inferred", "Lasting"):
        assert word not in said
    assert "not valid" in words(panel.list).split("\n") and "48.3" not in words(panel.list)
    assert not panel.compare.isVisible()


def test_a_scan_astray_is_pointed_to_its_position(panel, start, heard):
    panel.show_state(with_patient(start, ONE))
    assert not panel.known.align.isVisible()
    panel.resize(pp.PANEL_WIDTH, 360)
    panel.show_state(with_patient(start, replace(ONE, scan=scan(is_astray=True))))
    assert panel.known.align.text() == "Align it first" and panel.known.fit.isEnabled()
    assert panel.known.align.geometry().right() < panel.known.fit.geometry().left()
    click(panel.known.align)
    box = panel.alignment.method
    assert panel.rect().contains(box.mapTo(panel, box.rect().center()))
    QTest.keyClick(box.view(), Qt.Key.Key_Down)
    QTest.keyClick(box.view(), Qt.Key.Key_Return)
    assert heard == [("reading_changed", replace(ONE.reading, align="icp"))]


def test_one_whose_fit_missed_cannot_be_compared_with(panel, start, heard):
    others = with_patient(
        with_patient(start, replace(TWO, fit=MISSED)), replace(ONE, key=3, name="p03", fit=FIT)
    )
    state = replace(with_patient(others, replace(ONE, fit=FIT)), compared=2)
    panel.show_state(state)
    box = panel.compare.box
    assert box.currentData() is None and state.reference == (FIT.person, FIT.values)
    hint = box.itemData(box.findText("p02.ply"), Qt.ItemDataRole.ToolTipRole)
    assert "cannot be compared with" in hint and "not valid" in hint
    box.setFocus()
    QTest.keyClick(box, Qt.Key.Key_Space)
    QTest.keyClick(box.view(), Qt.Key.Key_Down)  # over the one that is barred
    QTest.keyClick(box.view(), Qt.Key.Key_Return)
    assert heard == [("compared_chosen", 3)]


def test_a_new_result_is_scrolled_to(panel, start, qtbot):
    panel.resize(pp.PANEL_WIDTH, 500)
    panel.show_state(with_patient(start, ONE))
    qtbot.wait(20)
    panel.show_state(with_patient(start, replace(ONE, fit=FIT)))
    last = panel.result.findChildren(QLabel)[-1]

    def is_in_sight() -> bool:
        return bool(last.mapTo(panel, QPoint(0, last.height())).y() <= panel.height())

    qtbot.waitUntil(lambda: panel.result.height() > 150 and is_in_sight())


def test_other_fitted_patients_can_be_compared_with(panel, start, heard):
    state = with_patient(with_patient(start, replace(TWO, fit=FIT)), replace(ONE, key=3, name="p03.stl"))
    panel.show_state(with_patient(state, replace(ONE, fit=FIT)))
    texts = [panel.compare.box.itemText(i) for i in range(panel.compare.box.count())]
    assert texts == ["average at the same covariates", "this patient as fitted", "p02.ply"]
    assert panel.compare.box.currentText() == "this patient as fitted"
    choose(panel.compare.box, "p02.ply")
    panel.show_state(replace(with_patient(state, replace(ONE, fit=FIT)), compared=2))
    assert panel.compare.box.currentData() == 2
    choose(panel.compare.box, "this patient as fitted")
    choose(panel.compare.box, "average at the same covariates")
    assert heard == [("compared_chosen", 2), ("compared_chosen", None), ("compared_chosen", AVERAGE_KEY)]
    assert state.patient == 3
    panel.show_state(state)
    assert not panel.compare.isVisible()


def test_nothing_can_be_changed_during_a_fit(panel, start, heard):
    panel.show_state(with_patient(start, ONE))
    panel.set_editable(False)
    click(panel.known.fit)
    click(panel.open)
    assert heard == []
    panel.set_editable(True)
    click(panel.open)
    assert heard == [("open_requested",)]


def test_nothing_is_cut_off_on_the_right(panel, start):
    name = "subject_0001_visit_2_airway_segmentation_final_corrected.nii.gz"
    notes = (f"{name} is odd", "the surface is open: a hole of 1.2% of its area; close it")
    patient = replace(ONE, name=name, scan=scan(source=f"{name}, label 2", notes=notes), fit=FIT)
    panel.show_state(with_patient(start, patient))
    assert panel.list.parentWidget().minimumSizeHint().width() <= pp.PANEL_WIDTH - 12
