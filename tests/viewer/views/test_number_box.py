"""Numbers are taken as they are typed, or marked; nothing is changed and no keystroke is lost."""

from __future__ import annotations

import math

import pytest
from PySide6.QtCore import QLocale, QPoint, QPointF, Qt
from PySide6.QtGui import QKeySequence, QShortcut, QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLineEdit, QToolTip, QVBoxLayout, QWidget

from naisr_model.covariates import Covariate
from naisr_viewer.views.actions import COMMANDS
from naisr_viewer.views.number_box import NumberBox, parsed

AGE = Covariate("age", "months", "continuous", 117.0, 60.0, (1.0, 233.0))


class Stage(QWidget):
    """A box at 100 months beside another one, and what was heard of it."""

    def __init__(self) -> None:
        super().__init__()
        self.box, self.other = NumberBox(AGE, self), QLineEdit(self)
        column = QVBoxLayout(self)
        column.addWidget(self.box)
        column.addWidget(self.other)
        self.heard: list[float] = []
        self.box.committed.connect(self.heard.append)
        self.box.show_value(100.0)


@pytest.fixture
def stage(qtbot):
    stage = Stage()
    qtbot.addWidget(stage)
    with qtbot.waitExposed(stage):
        stage.show()
    stage.activateWindow()
    qtbot.waitUntil(stage.isActiveWindow)  # only then it hears keys
    return stage


def write(box: NumberBox, text: str) -> None:
    box.setFocus()
    box.selectAll()
    QTest.keyClicks(box, text)


def enter(box: NumberBox) -> None:
    QTest.keyClick(box, Qt.Key.Key_Return)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("12.345", 12.345),
        ("62.5", 62.5),
        ("62,5", 62.5),
        ("6e1", 60.0),
        (" 7 ", 7.0),
        ("153.5", 153.5),
        (".5e1", 5.0),
        ("+9", 9.0),
    ],
)
@pytest.mark.parametrize("language", [QLocale.Language.C, QLocale.Language.German])
def test_a_number_in_range_is_taken_as_it_was_typed(stage, text, value, language):
    usual = QLocale()
    QLocale.setDefault(QLocale(language))
    try:
        write(stage.box, text)
        assert stage.box.text() == text and stage.heard == []
        enter(stage.box)
    finally:
        QLocale.setDefault(usual)
    assert stage.heard == [value] and stage.box.value == value and not stage.box.complaint
    assert stage.box.text() == f"{value:g}"  # nothing else is shown than what was taken


@pytest.mark.parametrize(
    "text", ["240", "500", "999", "-5", "0", "1_000", "12 months", "1,5,0", "nan", "1e9"]
)
def test_what_cannot_be_taken_stays_and_is_marked(stage, text):
    write(stage.box, text)
    assert stage.box.text() == text
    enter(stage.box)
    assert QToolTip.isVisible() and "1 to 233 months" in QToolTip.text()  # without being hovered over
    stage.other.setFocus()
    assert stage.heard == [] and stage.box.text() == text
    assert stage.box.property("isWrong")
    assert "1 to 233 months" in stage.box.toolTip() and text in stage.box.toolTip()
    write(stage.box, "24")
    enter(stage.box)
    assert stage.heard == [24.0] and not stage.box.property("isWrong")


def test_leaving_the_box_finishes_and_nothing_is_told_twice(stage):
    write(stage.box, "120")
    stage.other.setFocus()
    stage.box.setFocus()
    stage.other.setFocus()
    assert stage.heard == [120.0]


def test_escape_takes_back_what_was_typed_and_only_then_belongs_to_the_window(stage, qtbot):
    escapes: list[int] = []
    QShortcut(QKeySequence(Qt.Key.Key_Escape), stage, lambda: escapes.append(1))
    write(stage.box, "240")
    QTest.keyClick(stage.box, Qt.Key.Key_Escape)
    assert stage.box.text() == "100" and stage.heard == [] and escapes == []
    QTest.keyClick(stage.box, Qt.Key.Key_Escape)
    assert escapes == [1]


SHORTCUTS = [keys for command in COMMANDS for keys in command.keys]


@pytest.mark.parametrize("keys", SHORTCUTS)
def test_the_window_s_shortcuts_work_while_the_box_has_the_focus(stage, keys):
    pressed: list[str] = []
    QShortcut(QKeySequence(keys), stage, lambda: pressed.append(keys))
    write(stage.box, "120")
    enter(stage.box)
    QTest.keySequence(stage.box, QKeySequence(keys))
    assert pressed == [keys] and stage.box.text() == "120"


@pytest.mark.parametrize("keys", [keys for keys in SHORTCUTS if keys[-1] not in "ZY" and keys != "Esc"])
def test_all_but_undo_and_escape_work_while_something_is_being_typed(stage, keys):
    pressed: list[str] = []
    QShortcut(QKeySequence(keys), stage, lambda: pressed.append(keys))
    write(stage.box, "120")
    QTest.keySequence(stage.box, QKeySequence(keys))
    assert pressed == [keys] and stage.box.text() == "120"


def test_undo_is_of_the_typing_until_that_is_taken(stage):
    pressed: list[int] = []
    QShortcut(QKeySequence("Ctrl+Z"), stage, lambda: pressed.append(1))
    write(stage.box, "12")
    QTest.keySequence(stage.box, QKeySequence("Ctrl+Z"))
    assert stage.box.text() == "100" and pressed == []
    QTest.keySequence(stage.box, QKeySequence("Ctrl+Z"))
    assert pressed == [1]


def test_a_taken_number_cannot_be_undone_by_the_box_where_the_window_has_no_undo(stage):
    write(stage.box, "120")
    enter(stage.box)
    QTest.keySequence(stage.box, QKeySequence("Ctrl+Z"))
    assert stage.box.text() == "120" and stage.box.value == 120.0


def test_the_same_number_written_otherwise_is_finished_too(stage):
    write(stage.box, "100.0")
    enter(stage.box)
    assert stage.box.text() == "100" and stage.heard == [] and not stage.box.isModified()


def test_an_emptied_box_shows_its_value_again(stage):
    stage.box.setFocus()
    stage.box.selectAll()
    QTest.keyClick(stage.box, Qt.Key.Key_Delete)
    enter(stage.box)
    assert stage.box.text() == "100" and stage.heard == []


def test_what_is_being_typed_outlives_other_news(stage):
    write(stage.box, "12")
    stage.box.show_value(100.0)
    assert stage.box.text() == "12"
    stage.box.show_value(130.0)
    assert stage.box.text() == "130"


def test_a_value_keeps_the_digits_that_are_not_shown(stage):
    stage.box.show_value(2.58370001)
    assert stage.box.text() == "3" and stage.box.value == 2.58370001
    stage.other.setFocus()
    assert stage.heard == []


def test_the_digits_that_are_shown_can_be_typed(stage):
    stage.box.show_value(100.3841275512)
    assert stage.box.text() == "100"
    write(stage.box, "100")
    enter(stage.box)
    assert stage.heard == [100.0] and stage.box.value == 100.0


def test_arrows_step_inside_the_range(stage):
    stage.box.setFocus()
    QTest.keyClick(stage.box, Qt.Key.Key_Up)
    assert stage.heard == [100.0 + stage.box.step]
    stage.box.put(232.0)
    QTest.keyClick(stage.box, Qt.Key.Key_PageUp)
    assert stage.heard[-1] == 233.0


def turn(box: NumberBox) -> bool:
    place = QPointF(5, 5)
    event = QWheelEvent(
        place, box.mapToGlobal(place), QPoint(), QPoint(0, 120), Qt.MouseButton.NoButton,
        Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase, False,
    )  # fmt: skip
    QApplication.sendEvent(box, event)
    return event.isAccepted()


def test_the_wheel_steps_only_where_somebody_types(stage):
    stage.other.setFocus()
    assert not turn(stage.box) and stage.heard == []
    stage.box.setFocus()
    turn(stage.box)
    assert stage.heard == [100.0 + stage.box.step]


def test_texts_as_numbers():
    assert parsed(AGE, "") is None and parsed(AGE, "  ") is None
    assert parsed(AGE, "−3") == -3.0 and parsed(AGE, "1 000") == 1000.0
    for text in ("abc", "1.2.3", "--1", "e5", "inf", "1,234"):  # the last may be two numbers
        number = parsed(AGE, text)
        assert number is not None and math.isnan(number)
