"""The section plane, as a hand finds it: above the shapes, in the captions, in undo and in sessions."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest

from naisr_viewer.control.section import SectionDesk
from naisr_viewer.control.sessions import SessionDesk
from naisr_viewer.control.worker import Worker
from naisr_viewer.engine.clinic import Clinic
from naisr_viewer.engine.sections import cut_of
from naisr_viewer.program.headless import drag, finish, pause
from naisr_viewer.state.layouts import FULL_SHAPE, TEMPLATE, Layout
from naisr_viewer.state.section import NORMALS, Plane, Section
from naisr_viewer.views.section_bar import SectionBar


@pytest.fixture
def ready(open_window, atlas_file, engine):
    window, controller = open_window((1280, 800))
    SectionDesk(window, controller)
    SessionDesk(window, controller, engine, Clinic(engine), Worker(), Worker(), None)
    controller.open(atlas_file)
    finish(window, controller)
    window.section_switched.emit()
    finish(window, controller)
    return window, controller


def bar(window) -> SectionBar:
    (found,) = window.findChildren(SectionBar)
    return found


def ellipse_mm2(axes, normal, offset_mm: float) -> float:
    reach = np.linalg.norm(np.multiply(axes, normal))
    return float(np.pi * np.prod(axes) * (1 - (offset_mm / reach) ** 2) / reach)


@pytest.mark.parametrize("plane", [Plane.SAGITTAL, Plane.CORONAL, Plane.AXIAL, Plane.FREE])
def test_every_cut_has_the_area_of_its_ellipse(ready, atlas, plane):
    window, controller = ready
    window.section_chosen.emit(plane)
    window.section_settled.emit(5.0)
    window.covariates.value_settled.emit("age", 180.0)
    finish(window, controller)
    section = controller.state.section
    assert section.plane is plane and section.offset_mm == 5.0
    axes = atlas.half_axes_mm(**dict(controller.state.named))
    cut = cut_of(controller.shown[FULL_SHAPE], section)
    assert cut.area_mm2 == pytest.approx(ellipse_mm2(axes, section.normal, 5.0), rel=0.02)
    told = f"cut {cut.area_mm2:,.0f}\u00a0mm²"
    assert told in window.shapes.caption(FULL_SHAPE) and told not in window.shapes.caption(TEMPLATE)


def test_a_slider_that_is_dragged_takes_the_cut_along_and_is_one_step_to_undo(ready, atlas):
    window, controller = ready
    window.section_chosen.emit(Plane.AXIAL)
    before = controller.state.section
    slider, areas = bar(window).slider, []
    QTest.mousePress(slider, Qt.MouseButton.LeftButton, pos=slider.place_of(0.5))
    for share in (0.6, 0.7, 0.8):
        QTest.mouseMove(slider, slider.place_of(share))
        areas.append(window.shapes.caption(FULL_SHAPE))
    QTest.mouseRelease(slider, Qt.MouseButton.LeftButton, pos=slider.place_of(0.8))
    assert len(set(areas)) == 3 and controller.state.section.offset_mm > before.offset_mm
    window.undo_requested.emit()
    assert controller.state.section == before
    window.undo_requested.emit()
    assert controller.state.section.plane is Plane.SAGITTAL
    window.redo_requested.emit()
    assert controller.state.section == before


def test_the_cut_follows_a_covariate_on_its_way_and_goes_with_the_plane(ready):
    window, controller = ready
    before = window.shapes.caption(FULL_SHAPE)
    drag(window.covariates.rows["age"], 0.45, 0.9)
    finish(window, controller)
    assert "cut " in window.shapes.caption(FULL_SHAPE) and window.shapes.caption(FULL_SHAPE) != before
    window.section_switched.emit()
    assert controller.state.section is None and not bar(window).isVisible()
    assert "cut " not in window.shapes.caption(FULL_SHAPE)


def middle(window) -> str:
    """The colour in the middle of the canvas."""
    picture = window.shapes.canvas.grabFramebuffer()
    return picture.pixelColor(picture.rect().center() - QPoint(0, 12)).name()


def test_half_of_the_shape_is_gone_and_the_cut_has_its_colour_unlit(ready):
    window, controller = ready
    window.layout_requested.emit(Layout.FULL_SHAPE)
    window.shapes.look_from("the left")
    finish(window, controller)
    pause(0.1)
    assert middle(window) == "#6f9fe8"  # flat: the colour of the full shape itself
    window.section_flipped.emit()
    pause(0.1)
    assert middle(window) != "#6f9fe8"
    window.shapes.look_from("the right")
    pause(0.1)
    assert middle(window) == "#6f9fe8"


def test_a_click_on_the_cut_is_on_no_surface(ready, qtbot):
    window, controller = ready
    window.layout_requested.emit(Layout.FULL_SHAPE)
    window.shapes.look_from("the left")
    finish(window, controller)
    pause(0.1)
    with qtbot.assertNotEmitted(window.shapes.clicked):
        QTest.mouseClick(window.shapes.canvas, Qt.MouseButton.LeftButton)
    window.section_switched.emit()
    with qtbot.waitSignal(window.shapes.clicked):
        QTest.mouseClick(window.shapes.canvas, Qt.MouseButton.LeftButton)


def test_a_session_brings_the_cut_back(ready, tmp_path):
    window, controller = ready
    window.section_settled.emit(7.5)
    wanted = Section(Plane.SAGITTAL, NORMALS[Plane.SAGITTAL][0], 7.5)
    window.session_place_chosen.emit(tmp_path / "s.json")
    finish(window, controller)
    window.section_switched.emit()
    window.session_requested.emit(tmp_path / "s.json")
    finish(window, controller)
    assert controller.state.section == wanted and bar(window).isVisible()
    assert "cut " in window.shapes.caption(FULL_SHAPE)


def test_the_triangles_are_drawn_until_they_are_not(ready):
    window, controller = ready
    window.layout_requested.emit(Layout.FULL_SHAPE)
    window.section_switched.emit()
    finish(window, controller)

    def colours() -> int:
        pause(0.1)
        picture = window.shapes.canvas.grabFramebuffer()
        middle = picture.rect().center()
        return len({picture.pixelColor(middle + QPoint(x, y)).name() for x in range(40) for y in range(40)})

    plain = colours()
    window.edges_switched.emit()
    assert controller.state.has_edges and colours() > 1.5 * plain
    window.edges_switched.emit()
    assert colours() == plain
