"""What to export: which surfaces, how fine, and where to."""

from __future__ import annotations

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

from naisr_model.exports import FORMATS
from naisr_viewer.panels.kinds import panels_in, title_of
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.layouts import Layout, Panel
from naisr_viewer.state.requests import EXACT_RESOLUTION, ExportChoice
from naisr_viewer.views.dialogs.pieces import buttons_of, column_in

RESOLUTIONS = (64, EXACT_RESOLUTION, 192, 256)


class ExportDialog(QDialog):
    """Which surfaces, in which format, how fine and where to."""

    def __init__(self, atlas: AtlasCard, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("Export surfaces")
        self.setMinimumWidth(460)
        panels = panels_in(Layout.SIDE_BY_SIDE, atlas)
        self.what = QComboBox(self)
        self.what.addItem("All views", panels)
        for panel in reversed(panels):
            self.what.addItem(title_of(panel), (panel,))
        self.format = QComboBox(self)
        self.format.addItems([name.upper() for name in FORMATS])
        self.detail = QComboBox(self)
        for resolution in RESOLUTIONS:
            usual = " (as on screen)" if resolution == EXACT_RESOLUTION else ""
            self.detail.addItem(f"{resolution}³{usual}", resolution)
        self.detail.setCurrentIndex(RESOLUTIONS.index(EXACT_RESOLUTION))
        self.folder = QLineEdit(str(Path.home()), self)
        self._compose()

    def choice(self) -> ExportChoice:
        """What the dialog says now."""
        panels: tuple[Panel, ...] = tuple(self.what.currentData())
        folder = Path(self.folder.text()).expanduser()
        return ExportChoice(panels, self.format.currentText().lower(), self.detail.currentData(), folder)

    def ask(self) -> ExportChoice | None:
        """Show the dialog; None when it was cancelled."""
        return self.choice() if self.exec() == QDialog.DialogCode.Accepted else None

    def _compose(self) -> None:
        browse = QPushButton("Browse…", self)
        browse.clicked.connect(self._browse)
        where = QHBoxLayout()
        where.addWidget(self.folder, 1)
        where.addWidget(browse)
        form = QFormLayout()
        form.addRow("Surfaces", self.what)
        form.addRow("Format", self.format)
        form.addRow("Detail", self.detail)
        form.addRow("Folder", where)
        note = QLabel(
            "Millimetres, z up; GLB: metres, y up, as the format says. A record beside each file (.json) "
            "tells the covariates and the atlas.",
            self,
        )
        note.setObjectName("muted")
        note.setWordWrap(True)
        column = column_in(self)
        column.addLayout(form)
        column.addWidget(note)
        column.addWidget(buttons_of(self, "Export"))

    def _browse(self) -> None:
        name = QFileDialog.getExistingDirectory(self, "Export into", self.folder.text())
        if name:
            self.folder.setText(name)
