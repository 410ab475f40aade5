"""The linked sub-plots."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import TypeVar

import numpy as np
import pytest
import trimesh
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QColor, QImage
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QScrollBar, QWidget
from pytestqt.qtbot import QtBot

from naisr_viewer.panels import scan, shape
from naisr_viewer.panels.kinds import all_panels, kind_of, panels_in, request_for
from naisr_viewer.panels.scales import PanelScale
from naisr_viewer.program.headless import pause
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.explorer import ExplorerState, opened, with_value
from naisr_viewer.state.layouts import FULL_SHAPE, TEMPLATE, Layout, Panel
from naisr_viewer.state.requests import Colouring, SurfaceRequest, SurfaceResult
from naisr_viewer.views.colours import SCALE_COLOURS
from naisr_viewer.views.shapes import canvas as cv
from naisr_viewer.views.shapes import shape_view as sv
from naisr_viewer.views.shapes.arrangement import Strips
from naisr_viewer.views.shapes.colour_bar import ColourBar
from naisr_viewer.views.shapes.drawing import DRAWING
from naisr_viewer.views.theme import DARK, LIGHT

BEFORE = Panel("before")
UNCERTAINTY = Panel("uncertainty")
CHANGE = Panel("change")
SCAN = Panel("scan")
W = TypeVar("W", bound=QWidget)

Surfaces = dict[Panel, SurfaceResult]


def computed(engine, card: AtlasCard, **values: float) -> Surfaces:
    """The surfaces of an atlas at the mean, but for these values."""
    state = opened(ExplorerState(), card)
    for name, value in values.items():
        state = with_value(state, name, value)
    requests = [request_for(state, panel, 40) for panel in panels_in(Layout.SIDE_BY_SIDE, card)]
    return {request.panel: engine.surface(request) for request in requests}


@pytest.fixture
def surfaces(engine, card: AtlasCard) -> Surfaces:
    return computed(engine, card)


@pytest.fixture
def view(qtbot: QtBot, card: AtlasCard, surfaces: Surfaces) -> Iterator[sv.ShapeView]:
    view = sv.ShapeView()
    view.resize(900, 600)
    view.show_atlas(card, LIGHT)
    view.show_panels(panels_in(Layout.SIDE_BY_SIDE, card))
    with qtbot.waitExposed(view):
        view.show()
    show(view, surfaces)
    yield view
    view.clear()
    view.deleteLater()


def show(view: sv.ShapeView, surfaces: Surfaces) -> None:
    for result in surfaces.values():
        view.show_surface(result)
    pause(0.03)


def rows_of_colour(view: sv.ShapeView, colour: str) -> int:
    """How many pixel rows hold a hue like ``colour``."""
    picture = view.grab().toImage()
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
    pause(0.06)
    view.drawn.disconnect(counts.append)
    return [count for count in counts if count]


def moved(result, offset_mm: float):
    """The same surface, moved upwards; the faces are the same array."""
    return replace(result, points_mm=result.points_mm + np.array([0, 0, offset_mm], np.float32))


def pixels(view: sv.ShapeView) -> np.ndarray:
    """The canvas without labels, red, green and blue, ``[height, width, 3]``."""
    assert view.canvas is not None
    image = view.canvas.grabFramebuffer().convertToFormat(QImage.Format.Format_RGB32)
    flat = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), image.bytesPerLine() // 4, 4)
    return flat[:, : image.width(), 2::-1].copy()


def beneath(view: sv.ShapeView, panel: Panel, kind: type[W], name: str = "") -> W | None:
    """What of this kind stands under the title of a sub-plot that is on screen; None without any."""
    title = view.title(panel).geometry()
    below = [
        each
        for each in view.findChildren(kind, name)
        if each.isVisible()
        and each.y() > title.bottom()
        and title.left() <= each.geometry().center().x() <= title.right()
    ]
    return min(below, key=lambda each: each.y(), default=None)


def caption(view: sv.ShapeView, panel: Panel) -> QWidget:
    found = beneath(view, panel, QLabel, "caption")
    assert found is not None
    return found


def mesh_in(view: sv.ShapeView, panel: Panel):
    """The triangles that VTK draws in a sub-plot that is on screen."""
    assert view.canvas is not None
    middle = view.title(panel).geometry().center().x() / view.width()
    here = [
        renderer
        for renderer in view.canvas.renderers
        if renderer.GetInteractive() and renderer.GetViewport()[0] < middle < renderer.GetViewport()[2]
    ]
    (renderer,) = here
    (actor,) = renderer.actors.values()
    return actor.mapper.dataset


def inside(view: sv.ShapeView, panel: Panel) -> tuple[slice, slice]:
    """Rows and columns of a sub-plot's shape in :func:`pixels`."""
    title, below = view.title(panel).geometry(), caption(view, panel).geometry()
    return slice(title.bottom() + 1, below.top()), slice(title.left(), title.right() + 1)


def test_only_what_changed_is_drawn_and_all_of_it_at_once(view, surfaces):
    first, second = surfaces[TEMPLATE], surfaces[FULL_SHAPE]

    def two_of_five() -> None:
        view.show_surface(moved(first, 1.0))
        view.show_surface(moved(second, 1.0))

    assert drawn_by(view, two_of_five) == [2]
    again = moved(first, 2.0)
    assert drawn_by(view, lambda: view.show_surface(again)) == [1]
    assert drawn_by(view, lambda: view.show_surface(again)) == []
    assert drawn_by(view, view.canvas.update) == []


def test_sub_plots_that_are_not_drawn_again_keep_their_pixels(view, surfaces):
    before = pixels(view)
    template, shape = inside(view, TEMPLATE), inside(view, FULL_SHAPE)
    assert len(np.unique(before[template].reshape(-1, 3), axis=0)) > 20
    for step in range(1, 4):
        view.show_surface(moved(surfaces[FULL_SHAPE], 2.0 * step))
        pause(0.03)
        now = pixels(view)
        np.testing.assert_array_equal(now[template], before[template])
        assert (now[shape] != before[shape]).any()
    view.canvas.refresh()
    np.testing.assert_allclose(pixels(view).astype(int), now, atol=3)


@pytest.mark.parametrize(
    "change",
    [
        lambda view: view.look_from("above"),
        lambda view: view.reset_camera(),
        lambda view: view.resize(800, 500),
        lambda view: view.set_theme(DARK),
        lambda view: view.set_moving(True),
        lambda view: QTest.mouseClick(view.canvas, Qt.MouseButton.LeftButton),
    ],
    ids=["direction", "framing", "size", "theme", "quality", "mouse"],
)
def test_what_concerns_all_draws_all(view, card, change):
    assert drawn_by(view, lambda: change(view))[0] == len(panels_in(Layout.SIDE_BY_SIDE, card))


def test_moved_vertices_leave_the_triangles_in_opengl_alone(view, surfaces):
    mesh, result = mesh_in(view, TEMPLATE), surfaces[TEMPLATE]
    triangles, since = mesh.GetPolys(), mesh.GetPolys().GetMTime()
    original = result.points_mm.copy()
    view.show_surface(moved(result, 5.0))
    assert mesh_in(view, TEMPLATE) is mesh
    assert mesh.GetPolys() is triangles
    assert triangles.GetMTime() == since
    assert mesh.bounds[5] == pytest.approx(original[:, 2].max() + 5, abs=1e-4)
    np.testing.assert_array_equal(result.points_mm, original)


def test_a_moved_surface_is_drawn_like_a_new_one(view, surfaces):
    result = surfaces[FULL_SHAPE]
    view.show_surface(moved(result, 6.0))
    in_place = pixels(view)
    view.show_surface(replace(moved(result, 6.0), faces=result.faces.copy()))
    np.testing.assert_array_equal(pixels(view), in_place)
    view.show_surface(result)
    assert (pixels(view) != in_place).any()


def test_surfaces_shown_before_anything_can_draw_appear_later(qtbot, surfaces, card, monkeypatch):
    monkeypatch.delitem(sys.modules, DRAWING)
    view = sv.ShapeView()
    qtbot.addWidget(view)
    view.resize(600, 400)
    view.show_atlas(card, LIGHT)
    view.show_panels(panels_in(Layout.SIDE_BY_SIDE, card))
    assert not view.is_ready
    view.show()
    show(view, surfaces)
    qtbot.waitUntil(lambda: view.is_ready, timeout=30_000)
    pause(0.05)
    assert rows_of_colour(view, shape.COLOUR) > 50
    view.clear()


def test_an_older_child_is_drawn_taller(view, engine, card):
    view.show_panels((FULL_SHAPE,))
    show(view, computed(engine, card))
    young = rows_of_colour(view, shape.COLOUR)
    show(view, computed(engine, card, age=200.0))
    old = rows_of_colour(view, shape.COLOUR)
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
    assert len({id(renderer.camera) for renderer in view.canvas.renderers}) == 1


def test_the_mouse_turns_all_shapes_at_once_and_draws_once_per_paint(view, card):
    canvas = view.canvas
    position = canvas.camera.position
    QTest.mousePress(canvas, Qt.MouseButton.LeftButton, pos=QPoint(100, 150))
    QTest.mouseMove(canvas, QPoint(160, 170))
    assert canvas.ren_win.GetMultiSamples() == 0
    assert drawn_by(view, lambda: None) == [len(panels_in(Layout.SIDE_BY_SIDE, card))]
    QTest.mouseRelease(canvas, Qt.MouseButton.LeftButton, pos=QPoint(160, 170))
    assert canvas.ren_win.GetMultiSamples() == cv.REST_SAMPLES
    assert np.linalg.norm(np.subtract(canvas.camera.position, position)) > 1
    paintings: list[int] = []
    pause(0.05)
    view.drawn.connect(paintings.append)
    for _ in range(10):
        canvas.refresh()
    pause(0.05)
    view.drawn.disconnect(paintings.append)
    assert paintings == [len(panels_in(Layout.SIDE_BY_SIDE, card))]


def test_the_users_zoom_survives_a_new_layout(view):
    camera = view.canvas.camera
    camera.parallel_scale /= 2
    view.show_panels((FULL_SHAPE,))
    zoomed = camera.parallel_scale
    view.reset_camera()
    assert camera.parallel_scale / zoomed == pytest.approx(2.0)


def test_another_layout_never_shows_a_sub_plot_beside_its_shape(view):
    """Zoomed in on the upper end: in another layout it may lie outside of all that is seen."""
    view.show_panels((FULL_SHAPE,))
    camera = view.canvas.camera
    camera.parallel_scale /= 6
    shift = np.array([0.0, 0.0, 45.0])
    camera.focal_point, camera.position = camera.focal_point + shift, camera.position + shift
    camera.parallel_scale *= 0.9
    camera.focal_point, camera.position = camera.focal_point + 2 * shift, camera.position + 2 * shift
    view.show_panels((TEMPLATE, FULL_SHAPE))
    pause(0.03)
    for panel in (TEMPLATE, FULL_SHAPE):
        assert (pixels(view)[inside(view, panel)] != rgb(LIGHT.canvas)).any()


def test_the_opening_view_can_be_had_again(view):
    view.look_from("the front")
    view.reset_camera()
    pause(0.03)
    opening = pixels(view)
    camera = view.canvas.camera
    camera.roll += 40
    camera.azimuth += 70
    camera.parallel_scale /= 3
    view.canvas.refresh()
    pause(0.03)
    assert (pixels(view) != opening).any()
    view.reset_camera()
    pause(0.03)
    np.testing.assert_allclose(pixels(view).astype(int), opening, atol=3)


def test_a_shape_that_grows_is_not_cut_along_the_words(view):
    """It is drawn behind title and caption, up to the edge of its sub-plot."""
    view.show_panels((FULL_SHAPE,))
    view.canvas.camera.parallel_scale /= 2
    view.canvas.refresh()
    pause(0.03)
    rows, columns = inside(view, FULL_SHAPE)
    seen = (pixels(view)[:, columns] != rgb(LIGHT.canvas)).any(axis=(1, 2))
    assert seen[: rows.start].any() and seen[rows.stop :].any()


def test_a_low_view_scrolls_from_row_to_row(view, card, qtbot):
    view.resize(420, 295)
    pause(0.03)
    (bar,) = view.findChildren(QScrollBar)
    assert bar.isVisible()
    seen = set()
    for row in range(bar.maximum() + 1):
        bar.setValue(row)
        pause(0.03)
        shown = [panel for panel in panels_in(Layout.SIDE_BY_SIDE, card) if view.title(panel).isVisible()]
        seen |= set(shown)
        for panel in shown:
            assert view.rect().contains(view.title(panel).geometry())
            assert view.rect().contains(caption(view, panel).geometry())
            assert (pixels(view)[inside(view, panel)] != rgb(LIGHT.canvas)).any()
    assert seen == set(panels_in(Layout.SIDE_BY_SIDE, card))
    view.resize(900, 600)
    assert not bar.isVisible()


def test_a_caption_is_wrapped_where_it_is_wider_than_its_sub_plot(view):
    view.resize(5 * 152, 700)
    view.set_caption(TEMPLATE, "25.3 cm³<br>mean distance 0.09 mm · 91 % beyond the scale", "")
    label = caption(view, TEMPLATE)
    assert label.heightForWidth(label.width()) <= label.height()
    assert label.geometry().bottom() < view.height()


def test_names_are_never_taken_for_markup(qtbot, card):
    name = "<b>BMI</b> & percentile_for age and sex in per cent of the reference population"
    odd = replace(card, covariates=(replace(card.covariates[0], name=name), *card.covariates[1:]))
    view = sv.ShapeView()
    qtbot.addWidget(view)
    view.resize(500, 500)
    view.show_atlas(odd, LIGHT)
    panel = Panel("effect", name)
    view.show_panels((panel, FULL_SHAPE))
    view.show()
    title = view.title(panel)
    assert title.textFormat() is Qt.TextFormat.PlainText and "<b>BMI</b>" in title.text()
    assert title.width() == 250
    assert "&lt;b&gt;BMI" in title.toolTip() and "<b>" not in title.toolTip()
    view.clear()


def test_directions_are_anatomical(view):
    view.look_from("the front")
    camera = view.canvas.camera
    forward = np.subtract(camera.focal_point, camera.position)
    np.testing.assert_allclose(forward / np.linalg.norm(forward), [0, 1, 0], atol=1e-6)  # y points backwards


def test_sampling_is_off_while_moving_and_made_up_for_at_rest(view):
    smooth = pixels(view)
    view.set_moving(True)
    assert (pixels(view) != smooth).any()
    view.set_moving(False)
    np.testing.assert_array_equal(pixels(view), smooth)


def test_no_surface_leaves_the_sub_plot_empty(view, engine, card, atlas, monkeypatch):
    monkeypatch.setattr(atlas, "template", lambda *_, **__: trimesh.Trimesh())
    empty = engine.surface(SurfaceRequest(card.path, TEMPLATE, (), 48))
    for _ in range(2):
        view.show_surface(replace(empty))
        pause(0.02)
    canvas = QColor(LIGHT.canvas)
    assert (pixels(view)[inside(view, TEMPLATE)] == (canvas.red(), canvas.green(), canvas.blue())).all()


def test_another_atlas_gets_a_canvas_of_its_own(view, surfaces, card):
    closed: list[bool] = []
    view.canvas.destroyed.connect(lambda: closed.append(True))
    view.show_atlas(card, DARK)
    view.show_panels((TEMPLATE, FULL_SHAPE))
    show(view, surfaces)
    assert closed == [True]
    assert rows_of_colour(view, shape.COLOUR) > 50


@pytest.fixture
def views(view, surfaces) -> sv.ShapeView:
    """The sub-plots of a fit with one surface in all of them, seen from the left."""
    view.show_panels((FULL_SHAPE, SCAN, UNCERTAINTY))
    for panel in (FULL_SHAPE, SCAN, UNCERTAINTY, BEFORE, CHANGE):
        view.show_surface(of(surfaces, panel))
    view.look_from("the left")
    pause(0.03)
    return view


def of(surfaces: Surfaces, panel: Panel, values_mm=None, limit_mm: float = 2.0) -> SurfaceResult:
    """The template's surface in another panel, coloured where there are values."""
    result, colouring = surfaces[TEMPLATE], None
    if values_mm is not None:
        values_mm = np.broadcast_to(np.asarray(values_mm, np.float32), len(result.points_mm)).copy()
        colouring = Colouring(values_mm, limit_mm, scale="unsigned" if panel == UNCERTAINTY else "signed")
    return replace(result, request=replace(result.request, panel=panel), colouring=colouring)


def middle(view: sv.ShapeView, panel: Panel) -> np.ndarray:
    """The median colour around the middle of a sub-plot's shape."""
    rows, columns = inside(view, panel)
    y, x = (rows.start + rows.stop) // 2, (columns.start + columns.stop) // 2
    return np.asarray(np.median(pixels(view)[y - 4 : y + 5, x - 4 : x + 5].reshape(-1, 3), axis=0))


def rgb(colour: str) -> np.ndarray:
    wanted = QColor(colour)
    return np.array([wanted.red(), wanted.green(), wanted.blue()], float)


@pytest.mark.parametrize(("panel", "share"), [(SCAN, -1.0), (SCAN, 0.0), (SCAN, 1.0), (UNCERTAINTY, 0.5)])
def test_a_surface_has_the_colours_of_its_bar(views, panel, share, surfaces):
    views.show_surface(of(surfaces, panel, 2.0 * share))
    place = share if panel == UNCERTAINTY else (share + 1) / 2
    colours = SCALE_COLOURS["signed" if panel == SCAN else "unsigned"]
    seen, expected = middle(views, panel), rgb(colours[round(place * (len(colours) - 1))])
    assert np.abs(seen - expected).max() < 25  # the light falls from the side
    others = [rgb(colour) for colour in colours]
    assert np.linalg.norm(seen - expected) < 1.01 * min(np.linalg.norm(seen - other) for other in others)


def test_beyond_the_scale_the_colour_is_that_of_its_end(views, surfaces):
    views.show_surface(of(surfaces, SCAN, 2.0))
    at_the_end = pixels(views)
    views.show_surface(of(surfaces, SCAN, 40.0))
    np.testing.assert_array_equal(pixels(views), at_the_end)


def test_vertices_differ(views, surfaces):
    heights = surfaces[TEMPLATE].points_mm[:, 2]
    views.show_surface(of(surfaces, SCAN, np.sign(heights)))
    rows, columns = inside(views, SCAN)
    shape = pixels(views)[rows, columns].astype(int)
    redder = (shape[:, :, 0] - shape[:, :, 2]).sum(axis=1)
    half = len(redder) // 2
    assert redder[: half - 5].sum() > 1000 and redder[half + 5 :].sum() < -1000


def test_colours_come_and_go_without_new_triangles(views, surfaces):
    plain, mesh = pixels(views), mesh_in(views, SCAN)
    triangles, since = mesh.GetPolys(), mesh.GetPolys().GetMTime()
    assert drawn_by(views, lambda: views.show_surface(of(surfaces, SCAN, 1.0))) == [1]
    coloured = pixels(views)
    assert (coloured != plain).any()
    assert drawn_by(views, lambda: views.show_surface(of(surfaces, SCAN, -1.0))) == [1]
    assert (pixels(views) != coloured).any()
    assert drawn_by(views, lambda: views.show_surface(of(surfaces, SCAN))) == [1]
    np.testing.assert_array_equal(pixels(views), plain)
    views.show_surface(moved(of(surfaces, SCAN, 1.0), 3.0))
    assert mesh_in(views, SCAN) is mesh and mesh.GetPolys() is triangles and triangles.GetMTime() == since


def test_a_moved_coloured_surface_is_drawn_like_a_new_one(views, surfaces):
    views.show_surface(of(surfaces, SCAN, 1.0))
    result = moved(of(surfaces, SCAN, -0.5), 4.0)
    views.show_surface(result)
    in_place = pixels(views)
    views.show_surface(replace(result, faces=result.faces.copy()))
    np.testing.assert_array_equal(pixels(views), in_place)


def scales_of(panels) -> dict[Panel, PanelScale]:
    """What kinds of view with numbers of their own have."""
    kinds = {panel: kind_of(panel) for panel in panels}
    return {
        panel: PanelScale(kind.scale, kind.unit, panel.kind, None)
        for panel, kind in kinds.items()
        if kind.scale
    }


def test_a_colour_bar_stands_between_shape_and_caption(views, card):
    with_bar = set()
    for panels in (panels_in(layout, card) for layout in Layout):
        views.show_panels(panels)
        views.show_scales(scales_of(panels))
        with_bar |= {panel for panel in panels if beneath(views, panel, ColourBar) is not None}
    assert with_bar == {panel for panel in all_panels(card) if kind_of(panel).scale}
    assert with_bar >= {SCAN, UNCERTAINTY, CHANGE}
    views.show_panels(panels_in(Layout.FIT, card))
    views.show_scales(scales_of(panels_in(Layout.FIT, card)))
    bar, shape, below = beneath(views, SCAN, ColourBar), inside(views, SCAN)[0], caption(views, SCAN)
    assert bar is not None
    place = bar.geometry()
    text_top = below.geometry().top() + below.contentsMargins().top()
    assert shape.stop <= place.top() and place.bottom() < text_top
    assert views.height() - text_top == Strips().caption
    assert abs(place.center().x() - views.title(SCAN).geometry().center().x()) <= 1
    plain = caption(views, FULL_SHAPE)
    assert plain.geometry().top() + plain.contentsMargins().top() == text_top


def test_the_bar_keeps_its_numbers_while_a_preview_is_plain(views, surfaces):
    views.show_panels((BEFORE, FULL_SHAPE, CHANGE))
    views.show_scales(scales_of((BEFORE, FULL_SHAPE, CHANGE)))
    bar = beneath(views, CHANGE, ColourBar)
    assert bar is not None
    assert bar.limit is None
    views.show_surface(of(surfaces, CHANGE, 1.0, limit_mm=5.0))
    views.show_surface(of(surfaces, CHANGE))
    assert bar.limit == 5.0


def test_the_usual_layouts_have_no_strip_for_bars(view, card):
    usual, labels = pixels(view), caption(view, FULL_SHAPE).geometry()
    view.show_panels((FULL_SHAPE, SCAN, UNCERTAINTY))
    view.show_scales(scales_of((FULL_SHAPE, SCAN, UNCERTAINTY)))
    view.show_panels(panels_in(Layout.SIDE_BY_SIDE, card))
    view.show_scales({})
    np.testing.assert_array_equal(pixels(view), usual)
    assert caption(view, FULL_SHAPE).geometry() == labels
    assert not any(bar.isVisible() for bar in view.findChildren(ColourBar))


def test_hidden_sub_plots_are_not_drawn(view, surfaces):
    def all_of_a_patient() -> None:
        for panel in (SCAN, UNCERTAINTY, BEFORE, CHANGE):
            view.show_surface(of(surfaces, panel))

    assert drawn_by(view, all_of_a_patient) == []


def test_panels_stand_in_the_order_asked_for(views):
    views.show_panels((BEFORE, FULL_SHAPE, CHANGE))
    lefts = [views.title(panel).x() for panel in (BEFORE, FULL_SHAPE, CHANGE)]
    assert lefts == sorted(lefts) and len(set(lefts)) == 3
    assert not views.title(SCAN).isVisible()


def ghost_of(surfaces: Surfaces, scale: float) -> tuple[np.ndarray, np.ndarray]:
    result = surfaces[TEMPLATE]
    return result.points_mm * np.float32(scale), result.faces


@pytest.mark.parametrize(("theme", "is_darker"), [(LIGHT, True), (DARK, False)], ids=["light", "dark"])
def test_a_ghost_lies_over_the_full_shape_alone(views, theme, is_darker, surfaces):
    views.set_theme(theme)
    pause(0.03)
    before, bare = pixels(views), middle(views, FULL_SHAPE)
    points_mm, faces = ghost_of(surfaces, 1.1)
    assert drawn_by(views, lambda: views.show_ghost(points_mm, faces)) == [1]
    assert drawn_by(views, lambda: views.show_ghost(points_mm, faces)) == []
    after, veiled = pixels(views), middle(views, FULL_SHAPE)
    assert (veiled.sum() < bare.sum()) == is_darker and np.abs(veiled - bare).max() > 15
    assert veiled[2] > veiled[0] + 15  # the blue of the shape is seen through it
    np.testing.assert_array_equal(after[inside(views, SCAN)], before[inside(views, SCAN)])
    canvas = rgb(theme.canvas)
    shape = inside(views, FULL_SHAPE)
    assert (after[shape] == canvas).all(axis=2).sum() < (before[shape] == canvas).all(axis=2).sum() - 500
    views.show_ghost(None)
    np.testing.assert_array_equal(pixels(views), before)


def test_a_ghost_inside_the_shape_is_hidden(views, surfaces):
    before = pixels(views)
    views.show_ghost(*ghost_of(surfaces, 0.8))
    np.testing.assert_array_equal(pixels(views), before)


def test_a_ghost_stays_where_it_is_while_the_shape_moves(views, surfaces):
    views.show_ghost(*ghost_of(surfaces, 1.1))
    before = pixels(views)
    start = of(surfaces, FULL_SHAPE)
    for step in (3.0, 6.0):
        views.show_surface(moved(start, step))
        pause(0.02)
        assert (pixels(views) != before).any()
    views.show_surface(start)
    np.testing.assert_array_equal(pixels(views), before)


def test_a_ghost_is_framed_with_the_shapes(views, surfaces):
    alone = views.canvas.box_mm()
    views.show_ghost(*ghost_of(surfaces, 1.5))
    np.testing.assert_allclose(views.canvas.box_mm(), 1.5 * alone, atol=0.1)
    views.show_panels((SCAN, UNCERTAINTY))
    np.testing.assert_allclose(views.canvas.box_mm(), alone, atol=0.1)


def test_a_ghost_of_points_is_dotted(views, surfaces):
    before = pixels(views)
    views.show_ghost(ghost_of(surfaces, 1.2)[0])
    changed = (pixels(views) != before).any(axis=2)
    surface = (before[inside(views, FULL_SHAPE)] != rgb(LIGHT.canvas)).any(axis=2).sum()
    assert 100 < changed[inside(views, FULL_SHAPE)].sum() < 0.6 * surface
    assert changed.sum() == changed[inside(views, FULL_SHAPE)].sum()


def test_a_new_atlas_has_no_ghost(views, card, surfaces):
    views.show_ghost(*ghost_of(surfaces, 1.1))
    views.show_atlas(card, LIGHT)
    views.show_panels((FULL_SHAPE, SCAN))
    pause(0.03)
    assert (pixels(views)[inside(views, FULL_SHAPE)] == rgb(LIGHT.canvas)).all()


def cloud(surfaces: Surfaces, values_mm=None) -> SurfaceResult:
    result = of(surfaces, SCAN, values_mm)
    return replace(result, faces=result.faces[:0], normals=np.zeros_like(result.normals))


def test_a_cloud_is_drawn_as_points(views, surfaces):
    whole = (pixels(views)[inside(views, SCAN)] != rgb(LIGHT.canvas)).any(axis=2).sum()
    views.show_surface(cloud(surfaces))
    dots = pixels(views)[inside(views, SCAN)]
    is_dot = (dots != rgb(LIGHT.canvas)).any(axis=2)
    assert 300 < is_dot.sum() < whole
    assert abs(QColor(*map(int, np.median(dots[is_dot], axis=0))).hue() - QColor(scan.KIND.colour).hue()) < 20
    views.show_surface(cloud(surfaces, 2.0))
    coloured = pixels(views)[inside(views, SCAN)]
    reds = coloured[(coloured != rgb(LIGHT.canvas)).any(axis=2)]
    assert (reds[:, 0].astype(int) - reds[:, 2] > 60).mean() > 0.5
    views.show_surface(of(surfaces, SCAN))
    assert (pixels(views)[inside(views, SCAN)] != rgb(LIGHT.canvas)).any(axis=2).sum() == whole
