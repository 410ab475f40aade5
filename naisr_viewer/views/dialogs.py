"""What the window asks for: files, and what to export."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Qt
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

from naisr_viewer.state.explorer import AtlasCard, ExplorerState, Panel, all_panels, panel_title
from naisr_viewer.state.patients import Labels
from naisr_viewer.state.requests import EXACT_RESOLUTION, FORMATS, ExportChoice

ATLAS_FILTER = "Atlas (*.safetensors);;All files (*)"
SCAN_ENDINGS = ("stl", "ply", "obj", "vtk", "vtp", "glb", "nii", "nii.gz", "nrrd", "csv", "txt", "xyz")
"""Meshes, label volumes and text files of points that can be opened as a scan."""

RESOLUTIONS = (64, EXACT_RESOLUTION, 192, 256)


def ask_open_path(parent: QWidget) -> Path | None:
    """The atlas to open, or None."""
    name, _ = QFileDialog.getOpenFileName(parent, "Open an atlas", "", ATLAS_FILTER)
    return Path(name) if name else None


def ask_scan_path(parent: QWidget) -> Path | None:
    """The scan to open, or None."""
    endings = " ".join(f"*.{ending}" for ending in SCAN_ENDINGS)
    filters = f"Meshes, label volumes and points ({endings});;All files (*)"
    name, _ = QFileDialog.getOpenFileName(parent, "Open a scan", "", filters)
    return Path(name) if name else None


def ask_landmarks_path(parent: QWidget) -> Path | None:
    """The landmarks of a scan, a CSV name,x,y,z in its own coordinates, or None."""
    filters = "Landmarks: name,x,y,z (*.csv);;All files (*)"
    name, _ = QFileDialog.getOpenFileName(parent, "Landmarks of the scan", "", filters)
    return Path(name) if name else None


def ask_label(parent: QWidget, labels: Labels) -> int | None:
    """Which label of a volume is the shape, or None when the question was cancelled."""
    dialog = LabelDialog(labels, parent)
    accepted = dialog.exec() == QDialog.DialogCode.Accepted
    dialog.deleteLater()
    return int(dialog.choice.currentData()) if accepted else None


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


class LabelDialog(QDialog):
    """Which label of a volume is the shape."""

    def __init__(self, labels: Labels, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("Choose a label")
        self.setMinimumWidth(380)
        question = QLabel(
            f"{labels.reading.path.name} holds {len(labels.titles)} labels. Which is the shape?"
        )
        question.setTextFormat(Qt.TextFormat.PlainText)
        question.setWordWrap(True)
        self.choice = QComboBox(self)
        self.choice.setAccessibleName("Label")
        for number, title in labels.titles:
            self.choice.addItem(title, number)
        column = _column(self)
        for widget in (question, self.choice, _buttons(self, "Open")):
            column.addWidget(widget)


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
        column = _column(self)
        column.addLayout(form)
        column.addWidget(note)
        column.addWidget(_buttons(self, "Export"))

    def _browse(self) -> None:
        name = QFileDialog.getExistingDirectory(self, "Export into", self.folder.text())
        if name:
            self.folder.setText(name)


def _column(dialog: QDialog) -> QVBoxLayout:
    column = QVBoxLayout(dialog)
    column.setContentsMargins(18, 18, 18, 14)
    column.setSpacing(14)
    return column


def _buttons(dialog: QDialog, accept: str) -> QDialogButtonBox:
    """Cancel, and what the Enter key does."""
    buttons = QDialogButtonBox(dialog)
    buttons.addButton("Cancel", QDialogButtonBox.ButtonRole.RejectRole)
    buttons.addButton(accept, QDialogButtonBox.ButtonRole.AcceptRole).setDefault(True)
    buttons.accepted.connect(dialog.accept)
    buttons.rejected.connect(dialog.reject)
    return buttons
