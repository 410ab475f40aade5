"""Which label of a volume is the shape."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLabel, QWidget

from naisr_viewer.state.patients import Labels, Reading
from naisr_viewer.views.dialogs.label import LabelDialog, ask_label


def test_a_label_is_chosen_by_its_title(qtbot):
    parent = QWidget()
    qtbot.addWidget(parent)
    labels = Labels(
        Reading(Path("/scans/p01.nii.gz")), ((1, "1: 3.2 cm³"), ("airway", "1 'airway': 41.9 cm³"))
    )

    def answer(key: Qt.Key) -> None:
        dialog = QApplication.activeModalWidget()
        assert isinstance(dialog, LabelDialog)
        texts = [each.text() for each in dialog.findChildren(QLabel) if each.isVisible()]
        assert any("p01.nii.gz holds 2 labels" in text for text in texts)
        QTest.keyClick(dialog.choice, Qt.Key.Key_Down)
        QTest.keyClick(dialog, key)

    QTimer.singleShot(0, lambda: answer(Qt.Key.Key_Return))
    assert ask_label(parent, labels) == "airway"
    QTimer.singleShot(0, lambda: answer(Qt.Key.Key_Escape))
    assert ask_label(parent, labels) is None
