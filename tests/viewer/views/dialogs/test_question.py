"""Questions before what cannot be undone, and the preferences that bring them back."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtCore import Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLabel, QMessageBox, QPushButton, QWidget

from naisr_viewer.state.questions import QUESTIONS, REPLACE_FILES, Answer
from naisr_viewer.views.dialogs.preferences import PreferencesDialog, ask_preferences
from naisr_viewer.views.dialogs.question import ask
from naisr_viewer.views.style_sheet import style_sheet
from naisr_viewer.views.theme import DARK, LIGHT, Theme, palette
from naisr_viewer.words.questions import NAMED, in_the_place_of

FILES = [Path(f"/out/eggs-{number}.stl") for number in range(NAMED + 2)]


@pytest.fixture
def parent(qtbot) -> QWidget:
    widget = QWidget()
    qtbot.addWidget(widget)
    return widget


def press(key: Qt.Key) -> None:
    """A key that the dialog in front hears."""
    dialog = QApplication.activeModalWidget()
    assert dialog is not None
    QTest.keyClick(dialog, key)


@pytest.mark.parametrize("is_last", [False, True])
@pytest.mark.parametrize(("button", "goes_on"), [("Replace", True), ("Cancel", False), (None, False)])
def test_only_a_yes_goes_on(parent, button, goes_on, is_last):
    seen = []

    def answer() -> None:
        dialog = QApplication.activeModalWidget()
        assert isinstance(dialog, QMessageBox)
        seen.append(dialog.text())
        if is_last:
            dialog.checkBox().click()
        if button:
            buttons = {each.text().replace("&", ""): each for each in dialog.buttons()}
            QTest.mouseClick(buttons[button], Qt.MouseButton.LeftButton)
        else:
            QTest.keyClick(dialog, Qt.Key.Key_Escape)

    QTimer.singleShot(0, answer)
    assert ask(parent, REPLACE_FILES, *in_the_place_of(FILES)) == Answer(goes_on, is_last)
    assert "These 8 files are there already, in /out:\n\neggs-0.stl" in seen[0] and "and 2 more" in seen[0]


def test_the_enter_key_does_nothing_that_cannot_be_undone(parent):
    QTimer.singleShot(0, lambda: press(Qt.Key.Key_Return))
    assert not ask(parent, REPLACE_FILES, *in_the_place_of(FILES)).goes_on


def test_names_are_no_markup(parent):
    def look() -> None:
        dialog = QApplication.activeModalWidget()
        assert isinstance(dialog, QMessageBox)
        (label,) = [each for each in dialog.findChildren(QLabel) if "p01" in each.text()]
        assert label.textFormat() is Qt.TextFormat.PlainText
        QTest.keyClick(dialog, Qt.Key.Key_Escape)

    QTimer.singleShot(0, look)
    ask(parent, REPLACE_FILES, *in_the_place_of([Path("/out/<b>p01</b>.stl")]))


def test_every_question_can_be_wanted_again(parent):
    def tick() -> None:
        dialog = QApplication.activeModalWidget()
        assert isinstance(dialog, PreferencesDialog)
        for box in dialog.boxes.values():
            box.click()
        (ok,) = [each for each in dialog.findChildren(QPushButton) if each.text() == "OK"]
        ok.click()

    asked = dict.fromkeys(QUESTIONS, False)
    QTimer.singleShot(0, tick)
    assert ask_preferences(parent, asked) == dict.fromkeys(QUESTIONS, True)
    QTimer.singleShot(0, lambda: press(Qt.Key.Key_Escape))
    assert ask_preferences(parent, asked) is None


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=["light", "dark"])
@pytest.mark.parametrize("is_ticked", [False, True])
def test_a_tick_box_stands_out_from_its_ground(qtbot, theme: Theme, is_ticked):
    before = QApplication.palette()
    QApplication.setPalette(palette(theme))
    dialog = PreferencesDialog(dict.fromkeys(QUESTIONS, is_ticked))
    qtbot.addWidget(dialog)
    dialog.setStyleSheet(style_sheet(theme))
    with qtbot.waitExposed(dialog):
        dialog.show()
    box = next(iter(dialog.boxes.values()))
    picture = box.grab().toImage()
    greys = [picture.pixelColor(x, box.height() // 2).lightness() for x in range(box.height())]
    QApplication.setPalette(before)
    assert max(greys) - min(greys) > 60
