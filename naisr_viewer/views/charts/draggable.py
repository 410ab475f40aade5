"""A chart over covariates with a mark at what is on screen that can be dragged, by mouse and by keys."""

from __future__ import annotations

import math
from abc import abstractmethod

from PySide6.QtCore import QPointF, Qt, QTimer, Signal
from PySide6.QtGui import QKeyEvent, QMouseEvent
from PySide6.QtWidgets import QWidget

from naisr_model.covariates import Covariate
from naisr_viewer.views.charts.chart import Chart
from naisr_viewer.views.elided import shortened
from naisr_viewer.views.theme import LIGHT, Theme

BEYOND_LEVELS = 1.6
"""How far the axis of a binary covariate reaches, whose levels are at -1 and 1."""

STREWN = 0.22
"""Half of the width over which people of one level of a binary covariate are strewn."""

GOLDEN = (5**0.5 - 1) / 2
"""Multiples of it, without what is before the point, lie evenly between 0 and 1."""

SETTLE_MS = 400
"""Keys count as one movement until they pause this long."""

STEPS = {
    Qt.Key.Key_Left: (-1, 0),
    Qt.Key.Key_Right: (1, 0),
    Qt.Key.Key_Down: (0, -1),
    Qt.Key.Key_Up: (0, 1),
}
KEY_STEPS = 100
"""Key presses from one end of a continuous covariate to the other."""

Place = tuple[float, ...]
"""Real values of the covariates along the axes: one to the right, and one upwards where there are two."""


class DraggableChart(Chart):
    """Takes hold of the mark or has it come, and tells where it goes; to show it there is the charts' own.

    Args:
        parent: the widget around it.
        grasp_px: who presses so near to the mark takes hold of it; elsewhere it comes to where is pressed.
        level_px: longer names of levels are shortened.
    """

    moved = Signal(tuple)  # a place: the mark is on its way
    settled = Signal(tuple)  # the same: it came to rest

    def __init__(self, parent: QWidget, grasp_px: float, level_px: int) -> None:
        super().__init__(parent)
        self._grasp_px, self._level_px = grasp_px, level_px
        self._theme = LIGHT
        self._covariates: tuple[Covariate, ...] = ()
        self._place: Place = ()
        self._grasp = QPointF()
        self._is_held = False
        self._pending: Place | None = None
        self._settle = QTimer(self, singleShot=True, interval=SETTLE_MS)
        self._settle.timeout.connect(self._settled)

    def show_place(self, *place: float) -> None:
        """Put the mark at the real values of what is on screen, without telling anybody."""
        self._place = place
        self._put_mark(place)

    @abstractmethod
    def _put_mark(self, place: Place) -> None:
        """Draw the mark there."""

    def set_theme(self, theme: Theme) -> None:
        """Follow the theme."""
        super().set_theme(theme)
        self._theme = theme

    def forget_move(self) -> None:
        """Say no more of a movement that has not come to rest."""
        self._settle.stop()
        self._is_held, self._pending = False, None

    def place_of(self, x: float, y: float = 0.0) -> QPointF:
        """Where real values are, in pixels of the widget."""
        return QPointF(self.mapFromScene(self.plotItem.vb.mapViewToScene(QPointF(x, y))))

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Take hold of the mark, or have it come."""
        scene = self.mapToScene(event.position().toPoint())
        if event.button() != Qt.MouseButton.LeftButton or not (self._covariates and self._place):
            return
        if not self.plotItem.vb.sceneBoundingRect().contains(scene):
            return
        away = self.place_of(*self._place) - event.position()
        is_near = math.hypot(*(away.x(), away.y())[: len(self._covariates)]) <= self._grasp_px
        self._is_held, self._grasp = True, away if is_near else QPointF()
        if not is_near:
            self._go_to(event.position())

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Take the mark along."""
        if self._is_held:
            self._go_to(event.position() + self._grasp)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """Let go of it."""
        if event.button() == Qt.MouseButton.LeftButton and self._is_held:
            self._is_held = False
            self._settled()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Arrows along the axes move the mark."""
        steps = STEPS.get(Qt.Key(event.key()), ())[: len(self._covariates)]
        if not (any(steps) and self._place):
            event.ignore()
            return
        along = zip(self._place, steps, self._covariates, strict=True)
        self._move(*(value + step * _key_step(covariate) for value, step, covariate in along))
        self._settle.start()

    def _go_to(self, position: QPointF) -> None:
        real = self.plotItem.vb.mapSceneToView(self.mapToScene(position.toPoint()))
        self._settle.stop()
        self._move(real.x(), real.y())

    def _move(self, *place: float) -> None:
        goal = tuple(map(_chosen, self._covariates, place))
        if goal != self._place:
            self._pending = goal
            self.moved.emit(goal)

    def _settled(self) -> None:
        self._settle.stop()
        if self._pending is not None:
            place, self._pending = self._pending, None
            self.settled.emit(place)

    def _ticks(self, covariate: Covariate) -> list[list[tuple[float, str]]] | None:
        """Levels by their names; None leaves numbers to the axis."""
        if covariate.kind == "continuous":
            return None
        names = (shortened(name, self.fontMetrics(), self._level_px) for name in covariate.levels)
        return [list(zip((-1.0, 1.0), names, strict=True))]


def extent(covariate: Covariate, margin: float) -> tuple[float, float]:
    """What is seen of the axis of a covariate: its range, and a share of it beyond each end."""
    low, high = covariate.range
    if covariate.kind == "binary":
        return -BEYOND_LEVELS, BEYOND_LEVELS
    return low - margin * (high - low), high + margin * (high - low)


def _chosen(covariate: Covariate, value: float) -> float:
    """The value that is taken where the mark is: as round as it is shown, the ends exactly."""
    low, high = covariate.range
    return min(max(round(min(max(value, low), high), covariate.decimals), low), high)


def _key_step(covariate: Covariate) -> float:
    """How far a key press moves: from level to level of a binary covariate, with the middle between them."""
    low, high = covariate.range
    return 1.0 if covariate.kind == "binary" else (high - low) / KEY_STEPS
