"""What a covariate's value is typed into or chosen with."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDoubleSpinBox, QPushButton, QWidget

from naisr_model.covariates import Covariate
from naisr_viewer.words.numbers import decimals
from naisr_viewer.words.titles import label


class ValueBox(QDoubleSpinBox):
    """A real value of a continuous covariate, inside its observed range."""

    def __init__(self, covariate: Covariate, parent: QWidget) -> None:
        super().__init__(parent)
        low, high = covariate.range
        self.setDecimals(decimals(covariate))
        self.setRange(low, high)
        self.setSingleStep(10.0 ** (1 - decimals(covariate)))
        self.setKeyboardTracking(False)
        self.setAlignment(Qt.AlignmentFlag.AlignRight)
        self.setFixedWidth(76)
        self.setToolTip(f"{low:g} to {high:g} {covariate.unit}".strip())
        self.setAccessibleName(f"{label(covariate.name)} in {covariate.unit}".removesuffix(" in "))


class LevelButton(QPushButton):
    """One level of a binary covariate."""

    def __init__(self, level: str, value: float, parent: QWidget) -> None:
        super().__init__(level, parent)
        self.level = value
        self.setCheckable(True)
        self.setMinimumWidth(38)
        self.setStyleSheet("padding: 3px 6px;")


def level_buttons(covariate: Covariate, parent: QWidget) -> list[LevelButton]:
    """A button for each level of a binary covariate."""
    levels = zip(covariate.levels, (-1.0, 1.0), strict=True)
    return [LevelButton(name, value, parent) for name, value in levels]
