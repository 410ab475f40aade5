"""The matrix as a user meets it, with mouse and keys."""

from __future__ import annotations

from dataclasses import replace

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QColor
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QDialog, QLabel

from naisr_model.progress import Progress
from naisr_viewer.control import jobs
from naisr_viewer.files.sessions import read_session
from naisr_viewer.panels.kinds import missing, visible_panels
from naisr_viewer.panels.matrix import here
from naisr_viewer.program.headless import finish, pause
from naisr_viewer.state.explorer import ExplorerState, opened
from naisr_viewer.state.layouts import Layout
from naisr_viewer.views.dialogs.export import ExportDialog
from naisr_viewer.views.matrix_bar import MatrixBar
from naisr_viewer.views.shapes.canvas import Canvas
from naisr_viewer.views.shapes.heads import HEAD_PX

LEFT = Qt.MouseButton.LeftButton


@pytest.fixture
def ready(whole_window, engine, atlas_file):
    window, controller = whole_window(engine)
    controller.open(atlas_file)
    finish(window, controller)
    window.covariates.value_settled.emit("sex", 1.0)
    window.layout_requested.emit(Layout.MATRIX)
    finish(window, controller)
    return window, controller


def middle(canvas: Canvas, column: int, row: int) -> QPoint:
    """Of a cell of five columns and four rows."""
    wide, high = canvas.width() - HEAD_PX, canvas.height() - HEAD_PX
    return QPoint(HEAD_PX + round((column + 0.5) * wide / 5), HEAD_PX + round((row + 0.5) * high / 4))


def turn(canvas: Canvas, start: QPoint) -> None:
    QTest.mousePress(canvas, LEFT, pos=start)
    QTest.mouseMove(canvas, start + QPoint(30, 0))
    QTest.mouseRelease(canvas, LEFT, pos=start + QPoint(30, 0))


def shown_texts(window) -> list[str]:
    return [label.text() for label in window.findChildren(QLabel) if label.isVisible()]


def test_a_click_on_a_cell_takes_its_covariates_as_one_step(ready, qtbot):
    window, controller = ready
    canvas, before = window.findChild(Canvas), controller.state.values
    matrix = controller.state.matrix
    QTest.mouseClick(canvas, LEFT, pos=middle(canvas, 3, 2))
    assert controller.state.values == (matrix.across.values[2], matrix.down.values[1], 1.0)
    assert window.covariates.rows["age"].box.value == matrix.across.values[2]
    assert controller.state.pins == ()
    finish(window, controller)
    controller.undo()
    assert controller.state.values == before
    turn(canvas, middle(canvas, 3, 2))
    assert controller.state.values == before
    QTest.mouseClick(canvas, LEFT, pos=middle(canvas, 1, 0) - QPoint(40, 50))  # beside the shape
    assert controller.state.values == (matrix.across.values[0], 35.0, 0.0)
    place = middle(canvas, 4, 3) + QPoint(0, 60)  # on the words beneath
    captions = [label for label in window.findChildren(QLabel, "caption") if label.isVisible()]
    (volume,) = [label for label in captions if label.geometry().contains(place)]
    QTest.mouseClick(volume, LEFT, pos=QPoint(5, 5))
    assert controller.state.values == (matrix.across.values[3], matrix.down.values[2], 0.0)


def test_what_is_nearest_comes_first_and_not_all_of_it_is_waited_for(engine, card):
    state = replace(opened(ExplorerState(), card), layout=Layout.MATRIX)
    wanted = missing(state, {}, 40)
    groups: list[jobs.Surfaces] = []
    jobs.frame(engine, wanted)(groups.append, Progress())
    assert [surface.request for group in groups for surface in group] == wanted
    assert len(groups) > 1 and groups[0][0].request.panel == here(state)


def test_a_double_click_goes_there(ready, qtbot):
    window, controller = ready
    canvas, matrix = window.findChild(Canvas), controller.state.matrix
    place = middle(canvas, 2, 1)
    QTest.mouseClick(canvas, LEFT, pos=place)
    QTest.mouseDClick(canvas, LEFT, pos=place)
    assert controller.state.layout is Layout.FULL_SHAPE
    assert controller.state.values == (matrix.across.values[1], matrix.down.values[0], 1.0)
    finish(window, controller)
    assert controller.state.pins == ()
    controller.undo()
    assert controller.state.values == (100.0, 35.0, 1.0)


def test_boxes_choose_what_is_laid_out_and_a_session_keeps_it(ready, qtbot, tmp_path):
    window, controller = ready
    bar = window.findChild(MatrixBar)
    assert bar.isVisible()
    bar.down.names.setFocus()
    QTest.keyClick(bar.down.names, Qt.Key.Key_Down)
    assert controller.state.matrix.down.covariate == "sex" and not bar.down.count.isEnabled()
    bar.across.count.setFocus()
    QTest.keyClick(bar.across.count, Qt.Key.Key_Up)
    assert len(controller.state.matrix.across.values) == 5
    finish(window, controller)
    assert len([text for text in shown_texts(window) if "cm³" in text]) == 6 * 3
    window.session_place_chosen.emit(tmp_path / "s.json")
    finish(window, controller)
    assert read_session(tmp_path / "s.json").state.matrix == controller.state.matrix
    window.layout_requested.emit(Layout.FULL_SHAPE)
    assert not bar.isVisible()


def test_cells_outside_the_data_are_pale_and_the_present_one_is_outlined(ready, qtbot):
    window, controller = ready
    canvas = window.findChild(Canvas)
    QTest.mouseClick(canvas, LEFT, pos=middle(canvas, 4, 3))
    finish(window, controller)
    pause(0.05)
    image = window.shapes.grab().toImage()

    def strength(column: int, row: int) -> int:
        return image.pixelColor(middle(canvas, column, row) - QPoint(0, 16)).saturation()

    assert strength(4, 3) > 1.5 * strength(4, 1)
    edge = image.pixelColor(QPoint(image.width() - 1, middle(canvas, 4, 3).y()))
    assert edge == QColor("#2f6fdb")
    assert image.pixelColor(QPoint(image.width() - 1, middle(canvas, 4, 1).y())) != edge


def test_the_figure_is_exported_from_the_dialog_and_not_over_another_one(ready, qtbot, monkeypatch, tmp_path):
    window, controller = ready

    def answer(dialog: ExportDialog) -> int:
        dialog.folder.setText(str(tmp_path))
        return QDialog.DialogCode.Accepted

    monkeypatch.setattr(ExportDialog, "exec", answer)
    window.ask_export()
    finish(window, controller)
    (pdf,) = tmp_path.rglob("*.pdf")
    assert len(list(pdf.parent.glob("*.stl"))) == len(visible_panels(controller.state))
    assert "a figure and 20 surfaces" in window.status.text()
    pdf.write_bytes(b"mine")
    window.ask_export()
    assert "is there already" in window.error_text.text() and pdf.read_bytes() == b"mine"
