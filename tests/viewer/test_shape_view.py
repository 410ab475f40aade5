"""The linked sub-plots."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
import pyvista as pv
import trimesh
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QColor, QImage
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
from naisr_viewer.views import canvas as cv
from naisr_viewer.views import shape_view as sv
from naisr_viewer.views.scale_bar import round_length_mm
from naisr_viewer.views.theme import DARK, LIGHT, SHAPE_COLOUR


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
    cv.aim(camera, box)
    assert cv.seen_size(camera, box) == pytest.approx((2.0, 6.0))
    np.testing.assert_allclose(camera.focal_point, [0, 0, 3])


def test_closed_surfaces_are_told_from_open_ones():
    faces = trimesh.creation.icosphere(subdivisions=1).faces
    assert cv.is_closed(faces)
    assert not cv.is_closed(faces[:-1])
    assert not cv.is_closed(np.vstack([faces[:-1], faces[-1][::-1]]))
    assert not cv.is_closed(faces[:0])


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


def drawn_by(view: sv.ShapeView, act) -> list[int]:
    """How many sub-plots each painting that follows ``act`` had to draw, where it had to draw any."""
    counts: list[int] = []
    view.drawn.connect(counts.append)
    act()
    QTest.qWait(60)
    view.drawn.disconnect(counts.append)
    return [count for count in counts if count]


def moved(result, offset_mm: float):
    """The same surface, moved upwards; the faces are the same array."""
    return replace(result, points_mm=result.points_mm + np.array([0, 0, offset_mm], np.float32))


def pixels(view: sv.ShapeView) -> np.ndarray:
    """The canvas without labels, red, green and blue, ``[height, width, 3]``."""
    assert view._canvas is not None
    image = view._canvas.grabFramebuffer().convertToFormat(QImage.Format.Format_RGB32)
    flat = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), image.bytesPerLine() // 4, 4)
    return flat[:, : image.width(), 2::-1].copy()


def inside(view: sv.ShapeView, panel: Panel) -> tuple[slice, slice]:
    """Rows and columns of a sub-plot's shape in :func:`pixels`."""
    title, volume = view.title(panel).geometry(), view._cells[panel].volume.geometry()
    return slice(title.bottom() + 1, volume.top()), slice(title.left(), title.right() + 1)


def test_only_what_changed_is_drawn_and_all_of_it_at_once(view):
    first, second = view._cells[TEMPLATE].result, view._cells[FULL_SHAPE].result

    def two_of_five() -> None:
        view.show_surface(moved(first, 1.0))
        view.show_surface(moved(second, 1.0))

    assert drawn_by(view, two_of_five) == [2]
    assert drawn_by(view, lambda: view.show_surface(view._cells[TEMPLATE].result)) == []
    assert drawn_by(view, view._canvas.update) == []


def test_sub_plots_that_are_not_drawn_again_keep_their_pixels(view):
    before = pixels(view)
    template, shape = inside(view, TEMPLATE), inside(view, FULL_SHAPE)
    assert len(np.unique(before[template].reshape(-1, 3), axis=0)) > 20
    for step in range(1, 4):
        view.show_surface(moved(view._cells[FULL_SHAPE].result, 2.0 * step))
        QTest.qWait(30)
        now = pixels(view)
        np.testing.assert_array_equal(now[template], before[template])
        assert (now[shape] != before[shape]).any()
    view._canvas.refresh()
    np.testing.assert_allclose(pixels(view).astype(int), now, atol=3)


@pytest.mark.parametrize(
    "change",
    [
        lambda view: view.look_from("above"),
        lambda view: view.reset_camera(),
        lambda view: view.resize(800, 500),
        lambda view: view.set_theme(DARK),
        lambda view: view.set_moving(True),
        lambda view: QTest.mouseClick(view._canvas, Qt.MouseButton.LeftButton),
    ],
    ids=["direction", "framing", "size", "theme", "quality", "mouse"],
)
def test_what_concerns_all_draws_all(view, change):
    assert drawn_by(view, lambda: change(view))[0] == len(view._cells)


def test_moved_vertices_leave_the_triangles_in_opengl_alone(view):
    mesh, result = view._canvas._plots[0].mesh, view._cells[TEMPLATE].result
    triangles, since = mesh.GetPolys(), mesh.GetPolys().GetMTime()
    original = result.points_mm.copy()
    view.show_surface(moved(result, 5.0))
    assert view._canvas._plots[0].mesh is mesh
    assert mesh.GetPolys() is triangles
    assert triangles.GetMTime() == since
    assert mesh.bounds[5] == pytest.approx(original[:, 2].max() + 5, abs=1e-4)
    np.testing.assert_array_equal(result.points_mm, original)


def test_a_moved_surface_is_drawn_like_a_new_one(view):
    result = view._cells[FULL_SHAPE].result
    view.show_surface(moved(result, 6.0))
    in_place = pixels(view)
    view.show_surface(replace(moved(result, 6.0), faces=result.faces.copy()))
    np.testing.assert_array_equal(pixels(view), in_place)
    view.show_surface(result)
    assert (pixels(view) != in_place).any()


def test_surfaces_shown_before_anything_can_draw_appear_later(qtbot, engine, card, monkeypatch):
    monkeypatch.delitem(sys.modules, sv.DRAWING)
    view = sv.ShapeView()
    qtbot.addWidget(view)
    view.resize(600, 400)
    view.show_atlas(card, LIGHT)
    view.show_panels(all_panels(card))
    assert not view.is_ready
    view.show()
    show(view, engine, card)
    qtbot.waitUntil(lambda: view.is_ready, timeout=10_000)
    QTest.qWait(50)
    assert rows_of_colour(view, SHAPE_COLOUR) > 50
    view.clear()


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


def test_all_sub_plots_share_one_camera(view):
    assert len({id(renderer.camera) for renderer in view._canvas.renderers}) == 1


def test_the_mouse_turns_all_shapes_at_once_and_draws_once_per_paint(view):
    canvas = view._canvas
    position = canvas.camera.position
    QTest.mousePress(canvas, Qt.MouseButton.LeftButton, pos=QPoint(100, 150))
    QTest.mouseMove(canvas, QPoint(160, 170))
    assert canvas.ren_win.GetMultiSamples() == 0
    assert drawn_by(view, lambda: None) == [len(view._cells)]
    QTest.mouseRelease(canvas, Qt.MouseButton.LeftButton, pos=QPoint(160, 170))
    assert canvas.ren_win.GetMultiSamples() == cv.REST_SAMPLES
    assert np.linalg.norm(np.subtract(canvas.camera.position, position)) > 1
    paintings: list[int] = []
    QTest.qWait(50)
    view.drawn.connect(paintings.append)
    for _ in range(10):
        canvas.refresh()
    QTest.qWait(50)
    view.drawn.disconnect(paintings.append)
    assert paintings == [len(view._cells)]


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


def test_sampling_is_off_while_moving_and_made_up_for_at_rest(view):
    smooth = pixels(view)
    view.set_moving(True)
    assert (pixels(view) != smooth).any()
    view.set_moving(False)
    np.testing.assert_array_equal(pixels(view), smooth)


def test_no_surface_leaves_the_sub_plot_empty(view, engine, card, atlas, monkeypatch):
    monkeypatch.setattr(atlas, "_surface", lambda *_: trimesh.Trimesh())
    empty = engine.surface(SurfaceRequest(card.path, TEMPLATE, (), 48))
    for _ in range(2):
        view.show_surface(replace(empty))
        QTest.qWait(20)
    canvas = QColor(LIGHT.canvas)
    assert (pixels(view)[inside(view, TEMPLATE)] == (canvas.red(), canvas.green(), canvas.blue())).all()


def test_another_atlas_gets_a_canvas_of_its_own(view, engine, card):
    first = view._canvas
    view.show_atlas(card, DARK)
    view.show_panels((TEMPLATE, FULL_SHAPE))
    assert first._closed
    show(view, engine, card)
    assert rows_of_colour(view, SHAPE_COLOUR) > 50
