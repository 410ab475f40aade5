"""The whole window on small screens, at every scaling and by keyboard: nothing is out of reach."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtGui import QImage
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractScrollArea,
    QApplication,
    QComboBox,
    QLabel,
    QLineEdit,
    QListWidget,
    QPushButton,
    QScrollArea,
    QSlider,
    QToolBar,
    QToolButton,
    QWidget,
)

from naisr_viewer.program.headless import pause
from naisr_viewer.state.explorer import ExplorerState, opened, with_patient
from naisr_viewer.state.layouts import Layout
from naisr_viewer.state.patients import Fitted, OpenScan, Reading, Scan
from naisr_viewer.state.section import Plane, Section
from naisr_viewer.state.theme import ThemeChoice
from naisr_viewer.views.drawer import Drawer
from naisr_viewer.views.elided import ElidedLabel
from naisr_viewer.views.main_window import MainWindow
from naisr_viewer.views.map_bar import MapBar
from naisr_viewer.views.section_bar import SectionBar

W = TypeVar("W", bound=QWidget)

SIZES = [(640, 400), (1024, 570), (1280, 770), (1600, 900)]
"""A screen of 1280x800 at a scaling of 2, and usual ones less the frame of a window."""

CONTROLS = (QAbstractButton, QLineEdit, QComboBox, QSlider, QListWidget)
LONG_NAME = "BMI percentile for age & sex <b>relative</b> to the reference population of 2007"
LONG_UNIT = "% of the <i>reference</i> population"


def patient(key: int, name: str, values) -> OpenScan:
    corners = np.array([[0, 0, 0], [9, 0, 0], [0, 9, 0]], np.float32)
    notes = ("the surface is open: holes of 8.3 % of its area", "its numbers looked like metres")
    scan = Scan(corners, corners, np.array([[0, 1, 2]]), f"{name}, 12,034 faces", notes=notes)
    intervals = tuple((covariate, value, value) for covariate, value in values)
    fit = Fitted(0, values, intervals, 48.31, 2.1, 0.31, 0.36, 2.3, ("the shape does not tell sex",))
    path = Path(f"/a/folder/that/is/named/at/length/{name}")
    return OpenScan(key, name, Reading(path), scan, fit=fit, is_changed=True)


@pytest.fixture(params=["short names", "long names"])
def state(request, card) -> ExplorerState:
    """Four patients, all fitted, whose files have changed."""
    if request.param == "long names":
        age, weight, sex = card.covariates
        odd = (
            replace(age, name=LONG_NAME, unit=LONG_UNIT),
            replace(weight, name="w" * 90, unit="kg"),
            replace(sex, name="<b>sex</b>", levels=("female as registered at birth", "male & other <i>")),
        )
        population = replace(card.population, covariates=odd)
        card = replace(card, name="an_atlas_<b>of</b>_" + "long" * 12, covariates=odd, population=population)
    result = opened(ExplorerState(), card)
    for key in range(1, 5):
        name = f"patient_{key}_<b>visit</b>_2024-03-14_segmentation_that_is_final.stl"
        result = with_patient(result, patient(key, name, result.named))
    section = Section(Plane.CORONAL, (0.0, 1.0, 0.0), -123.4)
    return replace(result, layout=Layout.FIT, section=section)


@pytest.fixture
def window(qtbot):
    window = MainWindow()
    window.resize(1280, 770)
    with qtbot.waitExposed(window):
        window.show()
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    yield window
    window.close()
    window.deleteLater()


def settle() -> None:
    for _ in range(3):
        QApplication.processEvents()
        pause(0.01)


def told(widget: QWidget) -> str:
    text = getattr(widget, "text", lambda: "")()
    return f"{type(widget).__name__} “{text or widget.accessibleName() or widget.objectName()}”"


def out_of_reach(widget: QWidget, window: QWidget) -> str:
    """Where a widget is cut off for good; empty where it can be seen, if need be by scrolling down."""
    rect = widget.rect()
    while widget is not window:
        parent = widget.parentWidget()
        assert parent is not None
        rect = QRect(widget.mapToParent(rect.topLeft()), rect.size())
        area = parent.parentWidget()
        is_scrolled = isinstance(area, QAbstractScrollArea) and parent is area.viewport()
        room = parent.rect().adjusted(0, -10_000, 0, 10_000) if is_scrolled else parent.rect()
        if not room.contains(rect):
            return f"{rect} is not inside {room} of {told(parent)}"
        rect = parent.rect() if is_scrolled else rect
        widget = parent
    return ""


def visible(window: QWidget, *kinds: type[W]) -> list[W]:
    return [each for kind in kinds for each in window.findChildren(kind) if each.isVisible()]


def cut_off(label: QLabel) -> bool:
    """Whether words are missing of a label that does not say so itself."""
    if isinstance(label, ElidedLabel) or not label.text():
        return False
    if label.wordWrap():
        return label.heightForWidth(label.width()) > label.height() + 1
    return label.sizeHint().width() > label.width() + 1


@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
def test_everything_can_be_reached(window, state, size):
    window.resize(*size)
    window.show_state(state)
    window.show_status(
        "Exact 128³ in 4.2 s · 99 % of the preview was within 0.01 mm · refining to 256³, 2 of 5"
    )
    window.show_error(
        f"No file {'/a/long/folder' * 12}/atlas.safetensors. " + "Correct it or untick it. " * 9
    )
    window.show_progress(0.5)
    settle()
    assert (window.width(), window.height()) == size
    lost = {told(each): out_of_reach(each, window) for each in visible(window, *CONTROLS, QLabel)}
    assert {name: why for name, why in lost.items() if why} == {}
    assert [told(each) for each in visible(window, QLabel) if cut_off(each)] == []
    buttons = visible(window, QPushButton)
    assert [told(each) for each in buttons if each.width() < each.minimumSizeHint().width()] == []
    names = [row.findChild(ElidedLabel, "covariate") for row in window.covariates.rows.values()]
    assert all(name is not None and name.width() >= 24 for name in names)


@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
def test_the_empty_window_fits_as_well(window, size):
    window.resize(*size)
    window.show_opening("an_atlas_with_a_name_of_some_length" * 3 + ".safetensors")
    settle()
    assert (window.width(), window.height()) == size
    assert [
        out_of_reach(each, window)
        for each in visible(window, *CONTROLS, QLabel)
        if out_of_reach(each, window)
    ] == []


def test_fit_warning_and_the_way_to_other_scans_are_always_in_sight(window, state):
    window.resize(640, 400)
    window.show_state(state)
    settle()
    for each in (window.patients.open, window.patients.known.fit, window.patients.scan.reread_changed):
        top_left = each.mapTo(window, QPoint(0, 0))
        assert window.childAt(each.rect().center() + top_left) is each


@pytest.mark.parametrize("theme", [ThemeChoice.LIGHT, ThemeChoice.DARK])
def test_a_toolbar_that_is_too_long_says_so(window, state, theme):
    window.show_theme(theme)
    window.show_state(state)
    window.resize(1024, 570)
    settle()
    (bar,) = window.findChildren(QToolBar)
    (more,) = [each for each in bar.findChildren(QToolButton) if each.accessibleName() == "More"]
    assert more.isVisible() and bar.rect().contains(more.geometry())
    assert more.width() >= 24 and contrast(window, more) > 80
    window.resize(1600, 900)
    settle()
    assert not more.isVisible()


def seen(window: QWidget, widget: QWidget) -> np.ndarray:
    """The pixels of a widget and of a rim around it, as grey values."""
    rect = QRect(widget.mapTo(window, QPoint(0, 0)), widget.size()).adjusted(-3, -3, 3, 3)
    image = window.grab(rect).toImage().convertToFormat(QImage.Format.Format_Grayscale8)
    flat = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), image.bytesPerLine())
    return flat[:, : image.width()].astype(int)


def contrast(window: QWidget, widget: QWidget) -> int:
    grey = seen(window, widget)
    return int(grey.max() - grey.min())


@pytest.mark.parametrize("theme", [ThemeChoice.LIGHT, ThemeChoice.DARK])
@pytest.mark.parametrize("is_ticked", [True, False])
def test_a_tick_box_has_a_frame(window, state, theme, is_ticked):
    """Told from the ground on all four sides of the box."""
    window.show_theme(theme)
    window.show_state(replace(state, follow=is_ticked))
    settle()
    box = window.covariates.follow
    assert box.isChecked() is is_ticked
    grey = seen(window, box)
    ground = grey[0, 0]
    rows = np.flatnonzero((np.abs(grey[:, :24] - ground) > 35).sum(axis=1) >= 8)
    columns = np.flatnonzero((np.abs(grey[:, :24] - ground) > 35).sum(axis=0) >= 8)
    assert rows[-1] - rows[0] >= 10 and columns[-1] - columns[0] >= 10


def stops(window: QWidget, first: QWidget) -> list[QWidget]:
    """What the Tab key goes through, once around."""
    first.setFocus()
    found = [first]
    for _ in range(200):
        QTest.keyClick(window.focusWidget(), Qt.Key.Key_Tab)
        if window.focusWidget() is first:
            return found
        found.append(window.focusWidget())
    raise AssertionError("the Tab key never comes around")


def region(window: MainWindow, widget: QWidget) -> tuple[int, int]:
    """Which part of the window a widget is in, from left to right and then down; above, in or below what
    scrolls there."""
    (drawer,), (maps,) = window.findChildren(Drawer), window.findChildren(MapBar)
    (section,) = window.findChildren(SectionBar)
    parts = [window.covariates, maps, section, window.shapes, drawer, window.patients, window.statusBar()]
    part = next(index for index, part in enumerate(parts) if part is widget or part.isAncestorOf(widget))
    areas = parts[part].findChildren(QScrollArea)
    if not areas or areas[0].isAncestorOf(widget):
        return part, 1
    top = [each.mapTo(window, QPoint(0, 0)).y() for each in (widget, areas[0])]
    return part, 0 if top[0] < top[1] else 2


def is_read_before(window: QWidget, one: QWidget, other: QWidget) -> bool:
    """Above it, or in the same line and left of it."""
    first, second = (QRect(each.mapTo(window, QPoint(0, 0)), each.size()) for each in (one, other))
    is_same_line = first.top() <= second.center().y() <= first.bottom()
    return first.left() < second.left() if is_same_line else first.top() < second.top()


@pytest.mark.parametrize("size", [(1280, 900), (640, 400)], ids=["usual", "small"])
def test_the_tab_key_goes_through_everything_as_it_is_read(window, state, size):
    window.resize(*size)
    window.show_state(state)
    settle()
    focusable = [
        each
        for each in visible(window, QWidget)
        if each.focusPolicy() & Qt.FocusPolicy.TabFocus and each.isEnabled() and each.focusProxy() is None
    ]
    found = stops(window, window.covariates.stops[1])
    assert {told(each) for each in focusable} == {told(each) for each in found}
    controls = [each for each in found if not isinstance(each, QScrollArea)]
    regions = [region(window, each) for each in controls]
    assert regions == sorted(regions)
    for one, other in itertools.pairwise(controls):
        if region(window, one) == region(window, other):
            assert is_read_before(window, one, other), f"{told(one)} before {told(other)}"


@pytest.mark.parametrize("theme", [ThemeChoice.LIGHT, ThemeChoice.DARK])
def test_whatever_has_the_focus_shows_it(window, state, theme):
    window.show_theme(theme)
    window.resize(1280, 1000)
    window.show_state(state)
    settle()
    unseen = []
    for stop in stops(window, window.covariates.stops[1]):
        stop.setFocus()
        for area in visible(window, QScrollArea):
            if area.isAncestorOf(stop):
                area.ensureWidgetVisible(stop)
        settle()
        with_focus = seen(window, stop)
        stop.clearFocus()
        settle()
        changed = np.abs(with_focus - seen(window, stop)) > 30
        if changed.sum() < 16:
            unseen.append(told(stop))
    assert unseen == []


def test_the_focus_is_kept_while_something_is_computed(window, state):
    window.show_state(state)
    settle()
    for stop in (window.patients.known.fit, window.patients.list, window.covariates.reset_all):
        stop.setFocus()
        window.set_editable(False)
        window.show_state(replace(state, has_ghost=False))
        window.set_editable(False)
        window.set_editable(True)
        assert stop.hasFocus()
    window.set_editable(False)
    window.set_editable(True)
    window.patients.list.setFocus()
    assert window.patients.list.hasFocus()


def test_no_name_is_taken_for_markup(window, state):
    """Of a label that guesses, Qt makes bold words out of a covariate named so."""
    window.show_state(state)
    window.show_error("No file <b>bold</b>.stl.")
    window.show_status("Saved <b>bold</b>.png")
    settle()
    for label in visible(window, QLabel):
        if "<b>" in label.text().replace("\u200b", ""):
            assert label.textFormat() is Qt.TextFormat.PlainText, told(label)
    for widget in window.findChildren(QWidget):
        assert "<b>visit" not in widget.toolTip() and "<b>sex" not in widget.toolTip(), told(widget)
        assert "<b>relative" not in widget.toolTip() and "<i>" not in widget.toolTip(), told(widget)
