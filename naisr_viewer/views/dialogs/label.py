"""Which label of a volume is the shape."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QComboBox, QDialog, QLabel, QWidget

from naisr_viewer.state.patients import Labels
from naisr_viewer.views.dialogs.pieces import buttons_of, column_in


class LabelDialog(QDialog):
    """Which label of a volume is the shape."""

    def __init__(self, labels: Labels, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("Choose a label")
        self.setMinimumWidth(380)
        count = f"{len(labels.titles)} labels" if len(labels.titles) > 1 else "a negative label alone"
        question = QLabel(f"{labels.reading.path.name} holds {count}. Which is the shape?")
        question.setTextFormat(Qt.TextFormat.PlainText)
        question.setWordWrap(True)
        self.choice = QComboBox(self)
        self.choice.setAccessibleName("Label")
        self.choice.addItems([title for _, title in labels.titles])
        column = column_in(self)
        for widget in (question, self.choice, buttons_of(self, "Open")):
            column.addWidget(widget)


def ask_label(parent: QWidget, labels: Labels) -> int | str | None:
    """Which label of a volume is the shape, or None when the question was cancelled."""
    dialog = LabelDialog(labels, parent)
    accepted = dialog.exec() == QDialog.DialogCode.Accepted
    dialog.deleteLater()
    return labels.titles[dialog.choice.currentIndex()][0] if accepted else None
