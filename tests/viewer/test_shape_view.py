"""The linked sub-plots."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
import pyvista as pv
import trimesh
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QColor
from PySide6.QtTest import QTest
from pytestqt.qtbot import QtBot

from naisr_viewer.requests import SurfaceRequest
from naisr_viewer.state import (
    FULL_SHAPE,
    TEMPLATE,
    AtlasCard,
    ExplorerState,
    Panel,
    all_panels,
    opened,
    panel_values,
    with_value,
)
from naisr_viewer.views import shape_view as sv
from naisr_viewer.views.scale_bar import round_length_mm
from naisr_viewer.views.theme import LIGHT, SHAPE_COLOUR


def test_cells_cover_the_canvas_without_overlap():
    for count in range(1, 9):
        for columns in range(1, count + 1):
            boxes = sv.cells(count, columns)
            assert len(boxes) == count
            assert sum(width * height for _, _, width, height in boxes) == pytest.approx(1)


def test_tall_shapes_stand_in_a_row_and_flat_ones_are_stacked():
    assert sv.columns_for(5, canvas_aspect=2.0, shape_aspect=0.3) == 5
    assert sv.columns_for(5, canvas_aspect=0.5, shape_aspect=4.0) == 1
    assert sv.columns_for(5, canvas_aspect=1.4, shape_aspect=0.9) == 3
    assert sv.columns_for(1, canvas_aspect=1.4, shape_aspect=0.9) == 1


@pytest.mark.parametrize(("pixels_per_mm", "length_mm"), [(1.0, 50), (0.9, 100), (4.0, 20), (100.0, 0.5)])
def test_scale_bars_have_round_lengths(pixels_per_mm, length_mm):
    assert round_length_mm(pixels_per_mm) == pytest.approx(length_mm)


def test_a_box_is_seen_at_its_true_size():
    camera = pv.Camera()
    camera.focal_point, camera.position, camera.up = (0, 0, 0), (0, -1, 0), (0, 0, 1)
    box = np.array([[-1.0, 1.0], [-2.0, 2.0], [0.0, 6.0]])
    sv.aim(camera, box)
    assert sv.seen_size(camera, box) == pytest.approx((2.0, 6.0))
    np.testing.assert_allclose(camera.focal_point, [0, 0, 3])


@pytest.fixture
def view(qtbot: QtBot, engine, card: AtlasCard) -> Iterator[sv.ShapeView]:
    view = sv.ShapeView()
    view.resize(900, 600)
    view.show_atlas(card, LIGHT)
    view.show_panels(all_panels(card))
    view.show()
    qtbot.waitExposed(view)
    show(view, engine, card)
    yield view
    view.clear()
    view.deleteLater()


def show(view: sv.ShapeView, engine, card: AtlasCard, **values: float) -> None:
    state = opened(ExplorerState(), card)
    for name, value in values.items():
        state = with_value(state, name, value)
    for panel in all_panels(card):
        view.show_surface(engine.surface(SurfaceRequest(card.path, panel, panel_values(state, panel), 40)))
    QTest.qWait(30)


def rows_of_colour(view: sv.ShapeView, colour: str) -> int:
    """How many pixel rows hold a hue like ``colour``."""
    picture = view.grab_image()
    hue = QColor(colour).hue()
    count = 0
    for y in range(0, picture.height(), 2):
        line = [picture.pixelColor(x, y) for x in range(0, picture.width(), 6)]
        count += any(abs(c.hue() - hue) < 12 and c.saturation() > 70 for c in line)
    return 2 * count


def test_all_sub_plots_share_one_camera(view):
    assert len({id(renderer.camera) for renderer in view._canvas.renderers}) == 1


def test_a_surface_is_replaced_in_place(view, engine, card):
    mesh = view._cells[FULL_SHAPE].mesh
    before = mesh.bounds
    show(view, engine, card, age=200.0)
    assert view._cells[FULL_SHAPE].mesh is mesh
    assert mesh.bounds[5] > before[5] + 10


def test_an_older_child_is_drawn_taller(view, engine, card):
    view.show_panels((FULL_SHAPE,))
    show(view, engine, card)
    young = rows_of_colour(view, SHAPE_COLOUR)
    show(view, engine, card, age=200.0)
    old = rows_of_colour(view, SHAPE_COLOUR)
    assert young > 100
    assert old / young == pytest.approx((45 + 15) / 45, rel=0.08)


def test_labels_follow_the_layout(view):
    assert "Age only" in view.title(Panel("effect", "age")).text()
    assert "do not add up" in view.title(Panel("effect", "age")).toolTip()
    view.show_panels((FULL_SHAPE,))
    assert view.title(FULL_SHAPE).isVisible()
    assert not view.title(TEMPLATE).isVisible()
    assert view.title(FULL_SHAPE).width() == view.width()


def test_captions_are_shown_as_given(view):
    view.set_caption(TEMPLATE, "48.2 cm³", "Enclosed volume")
    assert view.caption(TEMPLATE) == "48.2 cm³"


def test_the_mouse_turns_all_shapes_at_once_and_draws_once_per_paint(view):
    canvas = view._canvas
    position = canvas.camera.position
    QTest.mousePress(canvas, Qt.MouseButton.LeftButton, pos=QPoint(100, 150))
    QTest.mouseMove(canvas, QPoint(160, 170))
    QTest.mouseRelease(canvas, Qt.MouseButton.LeftButton, pos=QPoint(160, 170))
    assert np.linalg.norm(np.subtract(canvas.camera.position, position)) > 1
    drawn = []
    tag = canvas.ren_win.AddObserver("EndEvent", lambda *_: drawn.append(1))
    QTest.qWait(50)
    drawn.clear()
    for _ in range(10):
        view._canvas.update()
    QTest.qWait(50)
    canvas.ren_win.RemoveObserver(tag)
    assert len(drawn) == 1


def test_the_users_zoom_survives_a_new_layout(view):
    camera = view._canvas.camera
    camera.parallel_scale /= 2
    zoomed = view._fit_scale / camera.parallel_scale
    view.show_panels((FULL_SHAPE,))
    assert view._fit_scale / camera.parallel_scale == pytest.approx(zoomed)
    view.reset_camera()
    assert camera.parallel_scale == pytest.approx(view._fit_scale)


def test_directions_are_anatomical(view):
    view.look_from("the front")
    camera = view._canvas.camera
    forward = np.subtract(camera.focal_point, camera.position)
    np.testing.assert_allclose(forward / np.linalg.norm(forward), [0, 1, 0], atol=1e-6)  # y points backwards


def test_sampling_is_off_while_moving(view):
    view.set_moving(True)
    assert view._canvas.ren_win.GetMultiSamples() == 0
    QTest.qWait(20)
    view.set_moving(False)
    assert view._canvas.ren_win.GetMultiSamples() == sv.REST_SAMPLES
    QTest.qWait(20)


def test_no_surface_leaves_the_sub_plot_empty(view, engine, card, atlas, monkeypatch):
    monkeypatch.setattr(atlas, "_surface", lambda *_: trimesh.Trimesh())
    view.show_surface(engine.surface(SurfaceRequest(card.path, TEMPLATE, (), 48)))
    QTest.qWait(20)
    assert view._cells[TEMPLATE].mesh.n_points == 0
