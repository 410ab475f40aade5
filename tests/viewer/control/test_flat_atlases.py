"""An atlas of curves in the plane in the whole window, against ellipses whose truth is known."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from eggs import ellipse
from PIL import Image, ImageDraw
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QAction, QColor, QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QFileDialog

from naisr_model.data.curves import sound_curve
from naisr_model.shapes.written import csv_bytes, svg_bytes
from naisr_viewer.engine.curves import curves
from naisr_viewer.engine.engine import Engine
from naisr_viewer.panels.curves import curve_request
from naisr_viewer.panels.kinds import visible_panels
from naisr_viewer.program.headless import drag, finish
from naisr_viewer.state.drawer import Tab
from naisr_viewer.state.layouts import FULL_SHAPE, Layout, Panel
from naisr_viewer.state.overlay import Quantity
from naisr_viewer.state.requests import ExportChoice
from naisr_viewer.views.dialogs.export import ExportDialog
from naisr_viewer.views.ledger import EntryChart
from naisr_viewer.views.map_bar import MapBar
from naisr_viewer.views.shapes.canvas import Canvas

LEFT = Qt.MouseButton.LeftButton
TOLERATED = 0.05
"""Share of an area by which an atlas that was trained for some seconds may be off."""


@pytest.fixture
def ready(whole_window, ellipses, tmp_path):
    window, controller = whole_window(Engine(folder=tmp_path / "cache"))
    controller.open(ellipses / "a.safetensors")
    finish(window, controller)
    return window, controller


def area(age: float) -> float:
    return math.pi * 10 * (10 + age)


def offered(window) -> set[str]:
    return {action.text() for action in window.findChildren(QAction) if action.isVisible()}


def action(window, text: str) -> QAction:
    (found,) = [each for each in window.findChildren(QAction) if each.text() == text]
    return found


def middle(canvas: Canvas, cell: int, cells: int) -> QPoint:
    return QPoint(round((cell + 0.5) * canvas.width() / cells), canvas.height() // 2)


def pixels_unlike_the_ground(canvas: Canvas) -> int:
    """Of the whole canvas."""
    image = canvas.grab().toImage()
    ground = QColor(image.pixel(2, image.height() // 2))
    seen = np.frombuffer(image.convertToFormat(image.Format.Format_RGB32).constBits(), np.uint8)
    colours = seen.reshape(image.height(), image.width(), 4)[..., :3].astype(int)
    away = np.abs(colours - [ground.blue(), ground.green(), ground.red()]).sum(axis=2)
    return int((away > 60).sum())


def test_curves_are_filled_and_moved_but_never_turned(ready, qtbot):
    window, controller = ready
    canvas = window.findChild(Canvas)
    controller.set_layout(Layout.FULL_SHAPE)
    finish(window, controller)
    QApplication.processEvents()
    enclosed = pixels_unlike_the_ground(canvas) / window.shapes._pixels_per_mm**2
    assert enclosed == pytest.approx(controller.shown[FULL_SHAPE].extent, rel=0.06)
    before = window.shapes.camera
    start = middle(canvas, 0, 1)
    QTest.mousePress(canvas, LEFT, pos=start)
    for step in range(1, 5):
        QTest.mouseMove(canvas, start + QPoint(10 * step, 5 * step))
    QTest.mouseRelease(canvas, LEFT, pos=start + QPoint(40, 20))
    moved = window.shapes.camera
    gone = np.subtract(moved.focus_mm, before.focus_mm)
    scale = window.shapes._pixels_per_mm
    assert gone[:2] * scale == pytest.approx([-40, 20], abs=3) and gone[2] == 0
    assert np.subtract(moved.position_mm, moved.focus_mm)[:2] == pytest.approx([0, 0], abs=1e-6)
    assert moved.up == pytest.approx((0, 1, 0))
    wheel = QWheelEvent(
        QPointF(start), canvas.mapToGlobal(QPointF(start)), QPoint(), QPoint(0, 120), Qt.MouseButton.NoButton,
        Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase, False,
    )  # fmt: skip
    QApplication.sendEvent(canvas, wheel)
    assert window.shapes.camera.zoom < moved.zoom
    QTest.keyClick(window.shapes, Qt.Key.Key_Left)
    assert window.shapes.camera.up == pytest.approx((0, 1, 0))
    assert offered(window).isdisjoint({"Section plane", "Triangles", "From the front", "From above"})
    assert {"Reset camera", "Side by side", "Full shape"} <= offered(window)


def test_a_slider_gives_areas_and_curves_of_the_truth(ready):
    window, controller = ready
    row = window.covariates.rows["age"]
    drag(row, 0.5, 0.9)
    finish(window, controller)
    age = dict(controller.state.named)["age"]
    told = window.shapes.caption(FULL_SHAPE)
    assert "mm²" in told and "cm³" not in told
    assert controller.shown[FULL_SHAPE].extent == pytest.approx(area(age), rel=TOLERATED)
    top = controller.shown[FULL_SHAPE].points_mm[:, 1].max()
    assert top == pytest.approx(10 + age, abs=0.8)
    assert "128²" in window.status.text()


def test_curves_are_exported_as_drawings_and_text(ready, tmp_path):
    window, controller = ready
    controller.settle("age", 7.0)
    dialog = ExportDialog(controller.state, window)
    assert [dialog.format.itemText(i) for i in range(dialog.format.count())] == ["SVG", "CSV"]
    dialog.folder.setText(str(tmp_path))
    for ending in ("svg", "csv"):
        dialog.format.setCurrentText(ending.upper())
        controller.export(dialog.choice())
        finish(window, controller)
        (file,) = tmp_path.glob(f"*full-shape*.{ending}")
        assert sound_curve(file).curve.volume == pytest.approx(area(7.0), rel=TOLERATED)
        record = json.loads(file.with_name(f"{file.name}.json").read_text())
        assert record["area_mm2"] == pytest.approx(area(7.0), rel=TOLERATED)
        assert record["length_unit"] == "mm" and record["up"] == "y" and "volume_cm3" not in record
    dialog.deleteLater()


def test_the_matrix_needs_two_covariates_and_a_table_tells_areas(ready):
    window, _ = ready
    assert "Matrix" not in offered(window)
    action(window, "Copy table").trigger()
    assert "area [mm²]" in QApplication.clipboard().text()


def label_image(path: Path, age: float) -> int:
    """An ellipse of label 2 and debris of label 1, a pixel being a millimetre; how many pixels it has."""
    image = Image.new("L", (60, 60))
    draw = ImageDraw.Draw(image)
    draw.ellipse([20, 30 - (10 + age), 40, 30 + (10 + age)], fill=2)
    draw.rectangle([2, 2, 6, 6], fill=1)
    image.save(path)
    return int((np.asarray(image) == 2).sum())


@pytest.mark.parametrize("ending", ["svg", "csv"])
def test_an_outline_is_opened_and_fitted(ready, tmp_path, monkeypatch, ending):
    window, controller = ready
    file = tmp_path / f"p01.{ending}"
    file.write_bytes(svg_bytes(ellipse(7.0), "mm") if ending == "svg" else csv_bytes(ellipse(7.0)))
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *args, **more: (str(file), ""))
    action(window, "Open scan…").trigger()
    finish(window, controller)
    assert controller.state.shown.scan.extent == pytest.approx(area(7.0), rel=0.005)
    assert not window.patients.alignment.method.isEnabled()
    assert "fitted where they lie" in window.patients.alignment.method.toolTip()
    QTest.mouseClick(window.patients.known.fit, LEFT)
    finish(window, controller)
    fit = controller.state.fit
    assert fit.is_valid and dict(fit.values)["age"] == pytest.approx(7.0, abs=1.0)
    assert fit.extent == pytest.approx(area(7.0), rel=TOLERATED) and fit.extent_margin > 0
    assert {panel.kind for panel in visible_panels(controller.state)} == {
        "shape", "scan", "uncertainty", "deviation",
    }  # fmt: skip
    assert "mm²" in window.shapes.caption(FULL_SHAPE)


def test_of_a_label_image_a_label_is_chosen(ready, tmp_path, monkeypatch):
    window, controller = ready
    pixels = label_image(tmp_path / "p02.png", 6.0)
    monkeypatch.setattr(type(window), "ask_label", lambda _self, labels: labels.titles[-1][0])
    window.scan_requested.emit(tmp_path / "p02.png")
    finish(window, controller)
    shown = controller.state.shown
    assert shown.reading.label == 2 and shown.scan.extent == pytest.approx(pixels, rel=0.01)


def test_a_fitted_outline_is_followed_to_another_age(ready, tmp_path):
    window, controller = ready
    (tmp_path / "p01.csv").write_bytes(csv_bytes(ellipse(3.0)))
    window.scan_requested.emit(tmp_path / "p01.csv")
    finish(window, controller)
    window.patients.known.give((("age", 3.0),))
    QTest.mouseClick(window.patients.known.fit, LEFT)
    finish(window, controller)
    controller.set_layout(Layout.CHANGE)
    controller.settle("age", 8.0)
    finish(window, controller)
    change = controller.shown[Panel("change")]
    assert change.extent - change.extent_before == pytest.approx(area(8.0) - area(3.0), rel=0.2)
    top = np.argmax(change.points_mm[:, 1])
    assert change.colouring.values[top] == pytest.approx(5.0, abs=1.0)


def test_a_click_inside_pins_the_nearest_place_of_the_curve(ready, qtbot):
    window, controller = ready
    controller.settle("age", 8.0)
    finish(window, controller)
    canvas, cells = window.findChild(Canvas), len(visible_panels(controller.state))
    QTest.mouseClick(canvas, LEFT, pos=middle(canvas, cells - 1, cells))
    qtbot.waitUntil(lambda: any("Place 1" in chart.accessibleName() for chart in charts(window)))
    (pin,) = controller.state.pins
    assert pin.origin_mm[2] == 0 and abs(pin.origin_mm[0]) == pytest.approx(10, abs=1.5)


def charts(window) -> list[EntryChart]:
    return [chart for chart in window.findChildren(EntryChart) if chart.isVisible()]


def test_the_help_menu_opens_the_little_men(whole_window, tmp_path):
    window, controller = whole_window(Engine(folder=tmp_path / "cache"))
    action(window, "Little men in the plane").trigger()
    finish(window, controller)
    assert controller.state.atlas.name == "starman" and controller.state.atlas.is_flat
    drag(window.covariates.rows["arms"], 0.5, 0.8)
    finish(window, controller)
    assert "units²" in window.shapes.caption(FULL_SHAPE) and not window.error_text.text()


def test_maps_say_how_far_the_curve_has_come(ready):
    window, controller = ready
    controller.settle("age", 8.0)
    QTest.mouseClick(window.findChild(MapBar).buttons[Quantity.DISPLACEMENT], LEFT)
    finish(window, controller)
    shown = controller.shown[FULL_SHAPE]
    top = np.argmax(shown.points_mm[:, 1])
    mean = controller.state.atlas.covariates[0].centre
    assert shown.colouring.values[top] == pytest.approx(8.0 - mean, abs=0.8)


def test_the_drawer_shows_how_the_area_grows(ready):
    window, controller = ready
    action(window, "Curve").trigger()
    finish(window, controller)
    request = curve_request(controller.state)
    assert request is not None and controller.state.drawer is Tab.CURVE
    measured = curves(controller._engine, request)
    assert [one.name for one in measured.measures] == ["area", "length"]
    found = measured.find("area")
    assert found.unit == "mm²" and found.band is None
    inner = slice(3, -3)
    assert found.usual[inner] == pytest.approx([area(age) for age in measured.places[inner]], rel=TOLERATED)
    page = window._centre.curve
    told = [page.measure.itemText(i) for i in range(page.measure.count())]
    assert told == ["Area", "Length of the outline"]


def test_the_cache_gives_the_same_curve_at_the_next_start(ellipses, tmp_path):
    file = ellipses / "a.safetensors"
    first = Engine(folder=tmp_path)
    first.prepare_previews(first.open(file).path)
    again = Engine(folder=tmp_path)
    card = again.open(file)
    assert again.was_kept(file) and card.is_flat and card.frame.extent.unit == "mm²"
    assert not again.has_previews(file)


def test_no_screen_is_needed_to_ask_for_curves(ellipses, tmp_path):
    from naisr_viewer.files.exports import planned
    from naisr_viewer.files.surfaces import surface_files
    from naisr_viewer.state.explorer import ExplorerState, opened, with_value

    engine = Engine(folder=tmp_path / "cache")
    card = engine.open(ellipses / "a.safetensors")
    state = with_value(opened(ExplorerState(), card), "age", 8.0)
    (plan,) = planned(state, ExportChoice((FULL_SHAPE,), "csv", 64, tmp_path))
    result = engine.surface(plan.request)
    assert result.dim == 2 and result.extent == pytest.approx(area(8.0), rel=TOLERATED)
    (_, content), (_, record) = surface_files(plan.path, result, card)
    assert content.startswith(b"x,y,piece\n") and json.loads(record)["segments"] == len(result.faces)
