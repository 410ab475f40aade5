"""The people behind an atlas as dots, used with mouse and keys."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QWidget

from naisr_viewer.state.support import Support, axes_of, remoteness, visits_of
from naisr_viewer.views.charts.scatter import Scatter, edges, strewn
from naisr_viewer.views.theme import LIGHT

AGE_WEIGHT, AGE_SEX = Support("age", "weight"), Support("age", "sex")
HERE = {"age": 100.0, "weight": 35.0, "sex": 0.0}
LEFT = Qt.MouseButton.LeftButton


@pytest.fixture
def scatter(qtbot, card) -> Scatter:
    around = QWidget()
    around.resize(300, 260)
    qtbot.addWidget(around)
    scatter = Scatter(around)
    scatter.resize(300, 260)
    scatter.set_theme(LIGHT)
    scatter.show_visits(axes_of(AGE_WEIGHT, card), visits_of(AGE_WEIGHT, card))
    scatter.show_edge(remoteness(AGE_WEIGHT, card, HERE))
    scatter.show_place(100.0, 35.0)
    with qtbot.waitExposed(around):
        around.show()
    scatter.around = around
    return scatter


@pytest.fixture
def heard(scatter) -> list[tuple[str, float, float]]:
    """What it says, and whoever hears it puts the ring there."""
    acts: list[tuple[str, float, float]] = []
    scatter.moved.connect(lambda place: acts.append(("moved", *place)))
    scatter.moved.connect(lambda place: scatter.show_place(*place))
    scatter.settled.connect(lambda place: acts.append(("settled", *place)))
    return acts


def at(scatter: Scatter, x: float, y: float) -> QPoint:
    return scatter.place_of(x, y).toPoint()


def test_the_line_is_where_the_data_end(card):
    """A step across it, on either side."""
    people, steps = card.population, np.array([60.0, 20.0]) * 0.05
    found = 0
    for line in edges(remoteness(AGE_WEIGHT, card, HERE)):
        along = np.diff(line, axis=0) / [60.0, 20.0]
        across = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1, keepdims=True)
        for place, step in zip((line[1:] + line[:-1]) / 2, across * steps, strict=True):
            told = [people.has_data_at({"age": x, "weight": y}) for x, y in (place - step, place + step)]
            found += told == [True, False] or told == [False, True]
    total = sum(len(line) - 1 for line in edges(remoteness(AGE_WEIGHT, card, HERE)))
    assert total > 100 and found > 0.95 * total  # not in the sharp corners between the reaches of two people


def test_people_of_one_level_are_told_apart_near_it(card):
    visits = visits_of(AGE_SEX, card)
    places = strewn(visits.places, visits.subjects, axes_of(AGE_SEX, card))
    assert places[:, 0].tolist() == visits.places[:, 0].tolist()
    assert np.abs(places[:, 1] - visits.places[:, 1]).max() < 0.5
    assert len(set(places[:, 1])) == len(places)


def test_nothing_lies_over_the_dots(scatter):
    scatter.hide()
    scatter.show()
    assert [child for child in scatter.findChildren(QWidget) if child.isVisible()] == [scatter.viewport()]


def test_the_ring_is_dragged(scatter, heard):
    start = at(scatter, 100, 35) + QPoint(3, -2)  # nobody hits its middle
    QTest.mousePress(scatter.viewport(), LEFT, pos=start)
    assert heard == []  # it does not jump under the pointer
    for step in range(1, 11):
        QTest.mouseMove(scatter.viewport(), start + QPoint(4 * step, -3 * step))
    assert {kind for kind, _, _ in heard} == {"moved"} and len(heard) == 10
    QTest.mouseRelease(scatter.viewport(), LEFT, pos=start + QPoint(40, -30))
    moved, settled = heard[-2:]
    assert settled == ("settled", *moved[1:])
    goal = scatter.place_of(*settled[1:]) - scatter.place_of(100, 35)
    assert (goal - QPointF(40, -30)).manhattanLength() < 2
    assert settled[1] == round(settled[1]) and settled[2] == round(settled[2], 1)  # as round as shown


def test_a_click_elsewhere_brings_the_ring_there(scatter, heard):
    QTest.mouseClick(scatter.viewport(), LEFT, pos=at(scatter, 180, 60))
    assert [kind for kind, _, _ in heard] == ["moved", "settled"]
    assert heard[-1][1:] == pytest.approx((180, 60), abs=1)
    QTest.mouseClick(scatter.viewport(), Qt.MouseButton.RightButton, pos=at(scatter, 50, 20))
    QTest.mouseClick(scatter.viewport(), LEFT, pos=QPoint(2, 100))  # beside the axis
    assert len(heard) == 2


def test_a_drag_ends_where_the_ranges_do(scatter, heard):
    QTest.mousePress(scatter.viewport(), LEFT, pos=at(scatter, 100, 35))
    QTest.mouseMove(scatter.viewport(), QPoint(2000, -2000))
    QTest.mouseRelease(scatter.viewport(), LEFT, pos=QPoint(2000, -2000))
    assert heard[-1] == ("settled", 220.0, 95.0)


def test_arrow_keys_move_the_ring_and_are_one_act(scatter, heard, qtbot):
    scatter.setFocus()
    for key in (Qt.Key.Key_Right, Qt.Key.Key_Right, Qt.Key.Key_Up):
        QTest.keyClick(scatter, key)
    assert [kind for kind, _, _ in heard] == ["moved"] * 3
    qtbot.waitUntil(lambda: heard[-1][0] == "settled")
    assert heard[-1][1:] == pytest.approx((104, 35.9), abs=0.5)


def test_a_forgotten_movement_settles_nothing(scatter, heard):
    QTest.mousePress(scatter.viewport(), LEFT, pos=at(scatter, 150, 50))
    scatter.forget_move()
    QTest.mouseMove(scatter.viewport(), at(scatter, 60, 50))
    QTest.mouseRelease(scatter.viewport(), LEFT, pos=at(scatter, 60, 50))
    assert [kind for kind, _, _ in heard] == ["moved"]


def test_levels_are_met_and_stepped_through(scatter, heard, card):
    scatter.show_visits(axes_of(AGE_SEX, card), visits_of(AGE_SEX, card))
    scatter.show_place(100.0, 0.0)
    QTest.mouseClick(scatter.viewport(), LEFT, pos=at(scatter, 50, 1.2))
    assert heard[-1] == ("settled", 50.0, 1.0)
    QTest.keyClick(scatter, Qt.Key.Key_Down)
    QTest.keyClick(scatter, Qt.Key.Key_Down)
    assert [act[2] for act in heard[-2:]] == [0.0, -1.0]
    scatter.forget_move()


def test_the_window_appears_before_charts_are_imported():
    check = "import sys, naisr_viewer.views.main_window; sys.exit('pyqtgraph' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", check], check=False).returncode == 0
