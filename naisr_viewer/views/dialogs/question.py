"""Asked before something is done that cannot be undone."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QCheckBox, QMessageBox, QWidget

from naisr_viewer.state.questions import Answer, Question


def ask(parent: QWidget, question: Question, text: str, detail: str) -> Answer:
    """Whether it shall be done; Esc and the Enter key do nothing.

    Args:
        parent: the window that waits.
        question: what is asked.
        text: what would be lost.
        detail: names, one a line.
    """
    dialog = QMessageBox(parent)
    dialog.setIcon(QMessageBox.Icon.Warning)
    dialog.setWindowTitle(question.title)
    dialog.setTextFormat(Qt.TextFormat.PlainText)
    dialog.setText(f"{text}\n\n{detail}")  # as one: Qt takes an informative text for markup
    is_last = QCheckBox("&Don't ask again", dialog)
    dialog.setCheckBox(is_last)
    go_on = dialog.addButton(f"&{question.go_on}", QMessageBox.ButtonRole.DestructiveRole)
    dialog.setDefaultButton(dialog.addButton("Cancel", QMessageBox.ButtonRole.RejectRole))
    dialog.exec()
    answer = Answer(dialog.clickedButton() is go_on, is_last.isChecked())
    dialog.deleteLater()
    return answer
