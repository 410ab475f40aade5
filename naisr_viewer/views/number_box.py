"""What a number is typed into: no keystroke is dropped, and nothing is turned into something else."""

from __future__ import annotations

import math

from PySide6.QtCore import QEvent, Qt, Signal
from PySide6.QtGui import QFocusEvent, QKeyEvent, QWheelEvent
from PySide6.QtWidgets import QLineEdit, QToolTip, QWidget

from naisr_model.covariates import Covariate
from naisr_model.errors import InputError
from naisr_viewer.words.numbers import written
from naisr_viewer.words.titles import as_tip, label

LEAST_PX, WIDTH_PX = 76, 88
"""Eight digits have room where there is any."""
STEPS = {Qt.Key.Key_Up: 1, Qt.Key.Key_Down: -1, Qt.Key.Key_PageUp: 10, Qt.Key.Key_PageDown: -10}
EDITING = (Qt.Key.Key_A, Qt.Key.Key_C, Qt.Key.Key_V, Qt.Key.Key_X)
UNDOING = (Qt.Key.Key_Z, Qt.Key.Key_Y)
"""With Ctrl, what a box keeps from the window's shortcuts; the latter only while something is being typed."""


def parsed(covariate: Covariate, text: str) -> float | None:
    """A number as everywhere in the program; None for nothing, NaN for what is no number or in doubt."""
    if not text.strip():
        return None
    try:
        return covariate.parse(text)
    except InputError:
        return math.nan


class NumberBox(QLineEdit):
    """A real value of a continuous covariate.

    What is no number, may be two, or is outside the observed range, stays as it was typed, is marked and is
    not taken.
    """

    committed = Signal(float)  # a number inside the range is finished: by Enter, focus, arrow keys or wheel
    refused = Signal(str)  # why what was typed is not taken

    def __init__(self, covariate: Covariate, parent: QWidget) -> None:
        super().__init__(parent)
        self.covariate = covariate
        self._taken: float | None = None
        self.setAlignment(Qt.AlignmentFlag.AlignRight)
        self.setMinimumWidth(LEAST_PX)
        self.setMaximumWidth(WIDTH_PX)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName(f"{label(covariate.name)} in {covariate.unit}".removesuffix(" in "))
        self.textChanged.connect(self._mark)
        self._mark()

    @property
    def value(self) -> float | None:
        """What the text says, to the last digit of what was shown; None for nothing, NaN where it is none."""
        return parsed(self.covariate, self.text()) if self._is_unfinished else self._taken

    @property
    def complaint(self) -> str:
        """Why the text is not taken, with the range; empty where it is fine."""
        value = self.value
        if value is None or self.covariate.contains(value):
            return ""
        told = "not understood" if math.isnan(value) else "outside the data behind the atlas"
        return f"“{self.text()}” is {told}: {self.covariate.extent}"

    @property
    def step(self) -> float:
        """What an arrow key adds."""
        return float(10.0 ** (1 - self.covariate.decimals))

    def show_value(self, value: float | None) -> None:
        """Show a value, or nothing, telling nobody; what is being typed over the same value stays."""
        if value != self._taken or not self._is_unfinished:
            self.put(value)

    def put(self, value: float | None) -> None:
        """Show a value, or nothing, in place of whatever was being typed; nobody is told.

        The keystrokes that led there cannot be undone one by one any more: undo is the window's.
        """
        self._taken = value
        if self.text() != self._written(value) or self.isModified() or self.isRedoAvailable():
            self.setText(self._written(value))

    def step_by(self, steps: int) -> None:
        """Up or down from what is there, or from the population mean, inside the range."""
        value, (low, high) = self.value, self.covariate.range
        start = self.covariate.centre if value is None or math.isnan(value) else value
        self._take(min(max(start + steps * self.step, low), high))

    def finish(self) -> None:
        """Take what was typed, if it can be taken; else say why not, beside the box."""
        value = self.value
        if value is None:
            self._emptied()
        elif value == self._taken:
            self.put(value)
        elif self.complaint:
            self.refused.emit(self.complaint)
            QToolTip.showText(self.mapToGlobal(self.rect().bottomLeft()), self.toolTip(), self)
        else:
            self._take(value)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Enter finishes, Esc restores what was there, arrows step."""
        key = event.key()
        if key in STEPS:
            self.step_by(STEPS[Qt.Key(key)])
        elif key in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            self.finish()
        elif key == Qt.Key.Key_Escape and self._is_unfinished:
            self._restore()
        else:
            super().keyPressEvent(event)

    def focusOutEvent(self, event: QFocusEvent) -> None:
        """What was typed is finished."""
        super().focusOutEvent(event)
        if event.reason() != Qt.FocusReason.PopupFocusReason:
            self.finish()

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Step where the box has the focus; else the wheel belongs to what scrolls."""
        turned = event.angleDelta().y()
        if self.hasFocus() and turned:
            self.step_by(1 if turned > 0 else -1)
        else:
            event.ignore()

    def event(self, event: QEvent) -> bool:
        """Leave shortcuts to the window unless something is being typed."""
        if event.type() == QEvent.Type.ShortcutOverride and isinstance(event, QKeyEvent):
            if self._is_unfinished and event.key() == Qt.Key.Key_Escape:
                event.accept()
                return True
            kept = (*EDITING, *UNDOING) if self._is_unfinished else EDITING
            if event.modifiers() & Qt.KeyboardModifier.ControlModifier and event.key() not in kept:
                event.ignore()
                return False
        return super().event(event)

    @property
    def _is_unfinished(self) -> bool:
        return self.isModified()  # also by typing what was shown, which may have had more digits

    def _take(self, value: float) -> None:
        self.put(value)
        self.committed.emit(value)

    def _restore(self) -> None:
        """As if nothing had been typed."""
        self.put(self._taken)

    def _emptied(self) -> None:
        """Nothing is no value here."""
        self.put(self._taken)

    def _written(self, value: float | None) -> str:
        return "" if value is None else written(self.covariate, value)

    def _mark(self) -> None:
        self.setToolTip(as_tip(self.complaint or self.covariate.extent))
        self.setProperty("isWrong", bool(self.complaint))
        self.style().unpolish(self)
        self.style().polish(self)
