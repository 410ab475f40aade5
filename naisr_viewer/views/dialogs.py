"""What the window asks for: files, and what to export."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtWidgets import (
    QComboBox,
    QDialog,
    QDialogButtonBox,
    QFileDialog,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QMessageBox,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from naisr_viewer.requests import EXACT_RESOLUTION, FORMATS, ExportChoice
from naisr_viewer.state import AtlasCard, ExplorerState, Panel, all_panels, panel_title

ATLAS_FILTER = "Atlas (*.safetensors);;All files (*)"
RESOLUTIONS = (64, EXACT_RESOLUTION, 192, 256)


def ask_open_path(parent: QWidget, filters: str) -> Path | None:
    """The atlas to open, or None."""
    name, _ = QFileDialog.getOpenFileName(parent, "Open an atlas", "", filters)
    return Path(name) if name else None


def ask_image_path(parent: QWidget, state: ExplorerState) -> Path | None:
    """Where a picture goes, or None."""
    proposal = f"{state.atlas.name if state.atlas else 'atlas'}.png"
    name, _ = QFileDialog.getSaveFileName(parent, "Save a picture", proposal, "PNG (*.png)")
    return Path(name).with_suffix(".png") if name else None


def about(parent: QWidget, version: str) -> None:
    """Name, version and what the pictures mean."""
    QMessageBox.about(
        parent,
        "About NAISR Atlas Explorer",
        f"<h3>NAISR Atlas Explorer {version}</h3>"
        "<p>How a shape changes with age, weight, sex and other covariates, one covariate at a time "
        "and together.</p>"
        "<p>Method: Jiao et al., <i>NAISR: A 3D Neural Additive Model for Interpretable Shape "
        "Representation</i>, ICLR 2024.</p>"
        "<p>For research. Not a medical device.</p>",
    )


class ExportDialog(QDialog):
    """Which surfaces, in which format, how fine and where to."""

    def __init__(self, atlas: AtlasCard, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("Export surfaces")
        self.setMinimumWidth(460)
        panels = all_panels(atlas)
        self.what = QComboBox(self)
        self.what.addItem("All views", panels)
        for panel in reversed(panels):
            self.what.addItem(panel_title(panel), (panel,))
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
        note = QLabel("Millimetres. A .json beside each file records the covariates and the atlas.", self)
        note.setObjectName("muted")
        note.setWordWrap(True)
        buttons = QDialogButtonBox(self)
        buttons.addButton("Cancel", QDialogButtonBox.ButtonRole.RejectRole)
        export = buttons.addButton("Export", QDialogButtonBox.ButtonRole.AcceptRole)
        export.setDefault(True)
        buttons.accepted.connect(self.accept)
        buttons.rejected.connect(self.reject)
        column = QVBoxLayout(self)
        column.setContentsMargins(18, 18, 18, 14)
        column.setSpacing(14)
        column.addLayout(form)
        column.addWidget(note)
        column.addWidget(buttons)

    def _browse(self) -> None:
        name = QFileDialog.getExistingDirectory(self, "Export into", self.folder.text())
        if name:
            self.folder.setText(name)
