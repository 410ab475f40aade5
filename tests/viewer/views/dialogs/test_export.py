"""What to export, and where to."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QFileDialog, QPushButton

from naisr_viewer.panels.kinds import panels_in
from naisr_viewer.state.layouts import TEMPLATE, Layout, Panel
from naisr_viewer.state.requests import EXACT_RESOLUTION
from naisr_viewer.views.dialogs.export import ExportDialog


def test_all_views_are_proposed_as_they_are_on_screen(qtbot, card):
    dialog = ExportDialog(card)
    qtbot.addWidget(dialog)
    choice = dialog.choice()
    assert choice.panels == panels_in(Layout.SIDE_BY_SIDE, card)
    assert choice.resolution == EXACT_RESOLUTION
    assert choice.folder == Path.home()


def test_one_view_is_chosen_with_format_detail_and_folder(qtbot, card, monkeypatch, tmp_path):
    dialog = ExportDialog(card)
    qtbot.addWidget(dialog)
    monkeypatch.setattr(QFileDialog, "getExistingDirectory", lambda *_: str(tmp_path))
    for name, panel in (("Template", TEMPLATE), ("Sex only", Panel("effect", "sex"))):
        dialog.what.setCurrentIndex(dialog.what.findText(name))
        assert dialog.choice().panels == (panel,)
    dialog.format.setCurrentText("PLY")
    dialog.detail.setCurrentText("256³")
    (browse,) = [each for each in dialog.findChildren(QPushButton) if each.text() == "Browse…"]
    browse.click()
    choice = dialog.choice()
    assert (choice.format, choice.resolution, choice.folder) == ("ply", 256, tmp_path)


def test_a_cancelled_dialog_chooses_nothing(qtbot, card):
    dialog = ExportDialog(card)
    qtbot.addWidget(dialog)
    QTimer.singleShot(0, lambda: QTest.keyClick(dialog, Qt.Key.Key_Escape))
    assert dialog.ask() is None
