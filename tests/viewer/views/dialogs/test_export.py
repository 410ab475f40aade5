"""What to export, and where to."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QFileDialog, QPushButton

from naisr_viewer.panels.kinds import panels_in, visible_panels
from naisr_viewer.state.explorer import ExplorerState, opened
from naisr_viewer.state.layouts import FULL_SHAPE, TEMPLATE, Layout, Panel
from naisr_viewer.state.requests import EXACT_RESOLUTION
from naisr_viewer.views.dialogs.export import ExportDialog


@pytest.fixture
def state(card) -> ExplorerState:
    return opened(ExplorerState(), card)


@pytest.mark.parametrize("layout", [each for each in Layout if each is not Layout.MATRIX])
def test_all_views_are_proposed_as_they_are_on_screen(qtbot, card, state, layout):
    state = replace(state, layout=layout)
    dialog = ExportDialog(state)
    qtbot.addWidget(dialog)
    choice = dialog.choice()
    assert choice.panels == visible_panels(state)
    each = [dialog.what.itemData(index) for index in range(1, dialog.what.count())]
    assert sorted(each, key=str) == sorted(
        {(panel,) for panel in (*visible_panels(state), *panels_in(Layout.SIDE_BY_SIDE, card))}, key=str
    )
    assert choice.resolution == EXACT_RESOLUTION
    assert choice.folder == Path.home()


def test_the_matrix_is_proposed_whole_with_a_figure_that_single_views_do_not_have(qtbot, card, state):
    state = replace(state, layout=Layout.MATRIX)
    dialog = ExportDialog(state)
    qtbot.addWidget(dialog)
    dialog.show()
    assert dialog.choice().panels == visible_panels(state)
    assert dialog.figure is not None
    dialog.figure.setCurrentText("SVG")
    assert dialog.choice().figure == "svg"
    dialog.what.setCurrentIndex(1)
    assert not dialog.figure.isVisible()
    assert (dialog.choice().panels, dialog.choice().figure) == ((FULL_SHAPE,), "")


def test_one_view_is_chosen_with_format_detail_and_folder(qtbot, state, monkeypatch, tmp_path):
    dialog = ExportDialog(state)
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


def test_a_cancelled_dialog_chooses_nothing(qtbot, state):
    dialog = ExportDialog(state)
    qtbot.addWidget(dialog)
    QTimer.singleShot(0, lambda: QTest.keyClick(dialog, Qt.Key.Key_Escape))
    assert dialog.ask() is None


def test_a_folder_is_named_before_anything_is_written(qtbot, state, monkeypatch, tmp_path):
    dialog = ExportDialog(state)
    qtbot.addWidget(dialog)
    (button,) = [each for each in dialog.findChildren(QPushButton) if each.text() == "Export"]
    dialog.folder.setText("  ")
    assert not button.isEnabled()
    monkeypatch.chdir(tmp_path)
    for typed, folder in (("out", tmp_path / "out"), ("~/x", Path.home() / "x"), ("~nobody?/x", None)):
        dialog.folder.setText(typed)
        assert button.isEnabled()
        assert dialog.choice().folder == (folder or tmp_path / "~nobody?" / "x")
