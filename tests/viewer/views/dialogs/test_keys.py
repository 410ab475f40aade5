"""The sheet of keys tells every key that there is, as the actions have them."""

from __future__ import annotations

from PySide6.QtGui import QKeySequence
from PySide6.QtWidgets import QWidget

from naisr_viewer.views.actions import COMMANDS
from naisr_viewer.views.dialogs.keys import KeysSheet, sheet


def test_every_key_is_on_the_sheet_once(qtbot):
    parent = QWidget()
    qtbot.addWidget(parent)
    text = KeysSheet(parent).browser.toPlainText()
    for command in COMMANDS:
        for keys in command.keys:
            shown = QKeySequence(keys).toString(QKeySequence.SequenceFormat.NativeText)
            assert shown in text, command.name
    told = [keys for _, rows in sheet() for keys, _ in rows]
    assert len(told) == len(set(told))
