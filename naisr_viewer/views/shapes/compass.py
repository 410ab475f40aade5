"""Which way the body lies in a sub-plot: its axes with their letters, turning with the camera."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QPainter, QPaintEvent, QPalette, QPen
from PySide6.QtWidgets import QWidget

SIZE_PX = 58
ARM_PX, LETTER_PX = 15.0, 23.0
"""From the middle to the end of an axis, and to its letter."""

LETTER_BOX_PX = 14.0
ALONG = 1e-6
"""What lies in the picture counts as near."""

LEAST_NEAR, LEAST_FAR = 0.3, 0.75
"""Shares of its length from which on an end of an axis is drawn, on the near side and on the far one: those
that point to the eye, or away from it, would cover the others."""

LETTERS = (
    ("L", (1, 0, 0)),
    ("R", (-1, 0, 0)),
    ("P", (0, 1, 0)),
    ("A", (0, -1, 0)),
    ("S", (0, 0, 1)),
    ("I", (0, 0, -1)),
)
"""Left, right, back, front, head and feet of the body; x points left, y back, z up."""


class End(NamedTuple):
    """One end of an axis.

    Attributes:
        letter: which side of the body it is.
        x: to the right of the middle, 1 at full length.
        y: up from it.
        is_near: whether it is on the side of the eye.
    """

    letter: str
    x: float
    y: float
    is_near: bool


def ends(right: Sequence[float], up: Sequence[float]) -> list[End]:
    """What is seen of the axes of the body, far ends first.

    Args:
        right: direction to the right of the picture, of length 1.
        up: direction up in it.
    """
    axes: NDArray[np.float64] = np.array([direction for _, direction in LETTERS], float)
    across, along, near = axes @ right, axes @ up, axes @ np.cross(right, up)
    is_near = near > -ALONG
    is_seen = np.hypot(across, along) >= np.where(is_near, LEAST_NEAR, LEAST_FAR)
    order = [i for i in np.argsort(near, kind="stable") if is_seen[i]]
    return [End(LETTERS[i][0], float(across[i]), float(along[i]), bool(is_near[i])) for i in order]


class Compass(QWidget):
    """The axes of the body as the camera sees them.

    Args:
        parent: the widget that the shapes stand on.
    """

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self._ends: Sequence[End] = ()
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.resize(SIZE_PX, SIZE_PX)
        self.hide()

    @property
    def letters(self) -> dict[str, tuple[float, float]]:
        """Where each letter stands: to the right and up of the middle, 1 at full length."""
        return {letter: (x, y) for letter, x, y, _ in self._ends}

    def show_ends(self, found: Sequence[End]) -> None:
        """Draw what :func:`ends` has found, so that all compasses can share it."""
        self._ends = found
        self.setAccessibleName(f"Orientation: {', '.join(self.letters)}")
        self.update()

    def paintEvent(self, _event: QPaintEvent) -> None:
        """Far ends first and pale; where an axis points to the eye, nothing."""
        painter, middle = QPainter(self), QPointF(SIZE_PX / 2, SIZE_PX / 2)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        font = painter.font()
        font.setPixelSize(11)
        painter.setFont(font)
        palette = self.palette()
        for letter, x, y, is_near in self._ends:
            role = QPalette.ColorRole.PlaceholderText if is_near else QPalette.ColorRole.Mid
            painter.setPen(QPen(palette.color(role), 1.5))
            painter.drawLine(middle, middle + QPointF(ARM_PX * x, -ARM_PX * y))
            painter.setPen(
                palette.color(
                    QPalette.ColorRole.WindowText if is_near else QPalette.ColorRole.PlaceholderText
                )
            )
            box = QRectF(0, 0, LETTER_BOX_PX, LETTER_BOX_PX)
            box.moveCenter(middle + QPointF(LETTER_PX * x, -LETTER_PX * y))
            painter.drawText(box, Qt.AlignmentFlag.AlignCenter, letter)
        painter.end()
