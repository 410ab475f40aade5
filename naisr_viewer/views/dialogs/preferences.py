"""Which questions are asked."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtWidgets import QCheckBox, QDialog, QLabel, QVBoxLayout, QWidget

from naisr_viewer.state.questions import Question
from naisr_viewer.views.dialogs.pieces import buttons_of, column_in


class PreferencesDialog(QDialog):
    """A box for each question; ticked ones are asked.

    Args:
        asked: whether each question is asked now.
        parent: the window that waits.
    """

    def __init__(self, asked: Mapping[Question, bool], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("Preferences")
        self.setMinimumWidth(400)
        heading = QLabel("Ask before", self)
        heading.setObjectName("section")
        self.boxes = {question: QCheckBox(question.when, self) for question in asked}
        rows = QVBoxLayout()
        rows.setSpacing(8)
        rows.addWidget(heading)
        for question, box in self.boxes.items():
            box.setChecked(asked[question])
            rows.addWidget(box)
        column = column_in(self)
        column.addLayout(rows)
        column.addWidget(buttons_of(self, "OK"))

    def chosen(self) -> dict[Question, bool]:
        """What the boxes say now."""
        return {question: box.isChecked() for question, box in self.boxes.items()}


def ask_preferences(parent: QWidget, asked: Mapping[Question, bool]) -> dict[Question, bool] | None:
    """Which questions shall be asked, or None when nothing shall change."""
    dialog = PreferencesDialog(asked, parent)
    accepted = dialog.exec() == QDialog.DialogCode.Accepted
    dialog.deleteLater()
    return dialog.chosen() if accepted else None
