"""What a level of a binary covariate is chosen with."""

from __future__ import annotations

from PySide6.QtCore import QSize
from PySide6.QtWidgets import QPushButton, QWidget

from naisr_model.covariates import Covariate
from naisr_viewer.views.elided import shortened
from naisr_viewer.words.titles import as_entry, as_tip

LEAST_PX = 38
WIDEST_PX = 40
"""Longer names of levels are shortened."""


class LevelButton(QPushButton):
    """One level of a binary covariate, with its whole name on hover."""

    def __init__(self, level: str, value: float, parent: QWidget) -> None:
        super().__init__(parent)
        self.name, self.level = level, value
        self.ensurePolished()  # only then it knows its font
        self.setText(as_entry(shortened(level, self.fontMetrics(), WIDEST_PX)))
        self.setToolTip(as_tip(level))
        self.setCheckable(True)
        self.setStyleSheet("padding: 3px 6px;")

    def minimumSizeHint(self) -> QSize:
        """Room for its text, and enough to be hit."""
        hint = super().minimumSizeHint()
        return QSize(max(hint.width(), LEAST_PX), hint.height())


def level_buttons(covariate: Covariate, parent: QWidget) -> list[LevelButton]:
    """A button for each level of a binary covariate."""
    levels = zip(covariate.levels, (-1.0, 1.0), strict=True)
    return [LevelButton(name, value, parent) for name, value in levels]
