"""What a level of a binary covariate is chosen with."""

from __future__ import annotations

from PySide6.QtWidgets import QPushButton, QWidget

from naisr_model.covariates import Covariate


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
