"""Of all open scans together: their known covariates from a table, and a fit of each."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QWidget

from naisr_viewer.state.patients import OpenScan
from naisr_viewer.views.dialogs.files import ask_table_path
from naisr_viewer.views.patients.pieces import button

FIT_ALL_TIP = "Fit every open scan that has no fit, with what is known of it"
TABLE_TIP = "Take what is known of the open scans from a table with the columns mesh, subject and covariates"


class TogetherPart(QWidget):
    """What is done for several scans at once; absent while there are fewer than two."""

    table_chosen = Signal(object)  # Path of a table that was chosen

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.known = button("Known from table…", TABLE_TIP, "small")
        self.fit = button("Fit all", FIT_ALL_TIP, "small")
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(6)
        row.addWidget(self.known)
        row.addWidget(self.fit)
        row.addStretch(1)
        self.known.clicked.connect(self._ask)

    def show_patients(self, patients: tuple[OpenScan, ...], unfitted: int) -> None:
        """Offer what can be done for these, of whom some can be fitted and are not."""
        self.setVisible(len(patients) > 1)
        self.fit.setEnabled(unfitted > 0)

    def _ask(self) -> None:
        if (path := ask_table_path(self)) is not None:
            self.table_chosen.emit(path)
