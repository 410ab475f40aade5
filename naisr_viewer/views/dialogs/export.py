"""What to export: which surfaces, how fine, and where to."""

from __future__ import annotations

import os
from pathlib import Path

from PySide6.QtWidgets import (
    QComboBox,
    QDialog,
    QFileDialog,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QWidget,
)

from naisr_model.exports import CURVE_FORMATS, FORMATS
from naisr_viewer.panels.kinds import panels_in, title_of, visible_panels
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.layouts import Layout, Panel
from naisr_viewer.state.requests import EXACT_RESOLUTION, ExportChoice
from naisr_viewer.views.dialogs.pieces import buttons_of, column_in, enable_accept

FIGURES = ("pdf", "svg")

RESOLUTIONS = (64, EXACT_RESOLUTION, 192, 256)


FLAT_NOTE = (
    "In the unit of the atlas, y upwards. A record beside each file (.json) tells the covariates and the "
    "atlas. CSV also holds the numbers that are shown as colours."
)
NOTE = (
    "Millimetres, z up; GLB: metres, y up, as the format says. A record beside each file (.json) tells the "
    "covariates and the atlas. PLY and VTP also hold the numbers that are shown as colours."
)


class ExportDialog(QDialog):
    """Which surfaces, in which format, how fine and where to.

    Args:
        state: what is on screen; there is an atlas.
        parent: the window that waits.
    """

    def __init__(self, state: ExplorerState, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        assert state.atlas is not None
        is_flat = state.atlas.is_flat
        self.setWindowTitle("Export curves" if is_flat else "Export surfaces")
        self.setMinimumWidth(460)
        on_screen = visible_panels(state)
        is_matrix = state.layout is Layout.MATRIX
        singly = () if is_matrix else on_screen
        others = [each for each in panels_in(Layout.SIDE_BY_SIDE, state.atlas) if each not in on_screen]
        self.what = QComboBox(self)
        self.what.addItem("The matrix, with its figure" if is_matrix else "All views on screen", on_screen)
        for panel in (*reversed(singly), *reversed(others)):
            self.what.addItem(title_of(panel), (panel,))
        self.figure: QComboBox | None = QComboBox(self) if is_matrix else None
        self.format = QComboBox(self)
        self.format.addItems([name.upper() for name in (CURVE_FORMATS if is_flat else FORMATS)])
        self.detail = QComboBox(self)
        for resolution in RESOLUTIONS:
            usual = " (as on screen)" if resolution == EXACT_RESOLUTION else ""
            self.detail.addItem(f"{resolution}{'²' if is_flat else '³'}{usual}", resolution)
        self.detail.setCurrentIndex(RESOLUTIONS.index(EXACT_RESOLUTION))
        self.folder = QLineEdit(str(Path.home()), self)
        self._compose(is_flat)

    def choice(self) -> ExportChoice:
        """What the dialog says now."""
        panels: tuple[Panel, ...] = tuple(self.what.currentData())
        folder = Path(os.path.expanduser(self.folder.text().strip())).absolute()
        figure = self.figure.currentText().lower() if self.figure and self.what.currentIndex() == 0 else ""
        return ExportChoice(
            panels, self.format.currentText().lower(), self.detail.currentData(), folder, figure
        )

    def ask(self) -> ExportChoice | None:
        """Show the dialog; None when it was cancelled."""
        return self.choice() if self.exec() == QDialog.DialogCode.Accepted else None

    def _compose(self, is_flat: bool) -> None:
        browse = QPushButton("Browse…", self)
        browse.clicked.connect(self._browse)
        where = QHBoxLayout()
        where.addWidget(self.folder, 1)
        where.addWidget(browse)
        form = QFormLayout()
        form.addRow("&Curves" if is_flat else "&Surfaces", self.what)
        if self.figure is not None:
            self.figure.addItems([name.upper() for name in FIGURES])
            form.addRow("F&igure", self.figure)
            self.what.currentIndexChanged.connect(lambda index: form.setRowVisible(1, index == 0))
        form.addRow("&Format", self.format)
        form.addRow("&Detail", self.detail)
        label = QLabel("F&older", self)
        label.setBuddy(self.folder)
        form.addRow(label, where)
        note = QLabel(FLAT_NOTE if is_flat else NOTE, self)
        note.setObjectName("muted")
        note.setWordWrap(True)
        column = column_in(self)
        column.addLayout(form)
        column.addWidget(note)
        buttons = buttons_of(self, "Export")
        column.addWidget(buttons)
        self.folder.textChanged.connect(lambda text: enable_accept(buttons, bool(text.strip())))

    def _browse(self) -> None:
        name = QFileDialog.getExistingDirectory(self, "Export into", self.folder.text())
        if name:
            self.folder.setText(name)
