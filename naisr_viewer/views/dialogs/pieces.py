"""What the dialogs are put together from."""

from __future__ import annotations

from PySide6.QtWidgets import QComboBox, QDialog, QDialogButtonBox, QSizePolicy, QVBoxLayout


def column_in(dialog: QDialog) -> QVBoxLayout:
    """The column of a dialog, with room around it; no list in it makes it as wide as its longest name."""
    for box in dialog.findChildren(QComboBox):
        box.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        box.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
    column = QVBoxLayout(dialog)
    column.setContentsMargins(18, 18, 18, 14)
    column.setSpacing(14)
    return column


def buttons_of(dialog: QDialog, accept: str) -> QDialogButtonBox:
    """Cancel, and what the Enter key does."""
    buttons = QDialogButtonBox(dialog)
    buttons.addButton("Cancel", QDialogButtonBox.ButtonRole.RejectRole)
    buttons.addButton(accept, QDialogButtonBox.ButtonRole.AcceptRole).setDefault(True)
    buttons.accepted.connect(dialog.accept)
    buttons.rejected.connect(dialog.reject)
    return buttons


def enable_accept(buttons: QDialogButtonBox, is_enabled: bool) -> None:
    """Whether what the Enter key does can be done."""
    for button in buttons.buttons():
        if buttons.buttonRole(button) is QDialogButtonBox.ButtonRole.AcceptRole:
            button.setEnabled(is_enabled)
