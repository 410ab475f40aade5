"""Which files to open, chosen or dropped, and where a picture goes."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QMimeData
from PySide6.QtWidgets import QFileDialog, QWidget

from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.words.names import seen_stem

ATLAS_ENDING = ".safetensors"
ATLAS_FILTER = f"Atlas (*{ATLAS_ENDING});;All files (*)"
PICTURE_ENDING = ".png"
SESSION_ENDING = ".json"
SESSION_FILTER = f"Session (*{SESSION_ENDING})"
SCAN_ENDINGS = (
    *("stl", "ply", "obj", "vtk", "vtp", "glb"),
    *("nii", "nii.gz", "hdr", "hdr.gz", "img", "img.gz", "nrrd", "nhdr", "mha", "mhd"),
    *("csv", "txt", "xyz"),
)
"""Meshes, label volumes and text files of points that can be opened as a scan."""

OUTLINE_ENDINGS = ("svg", "csv", "txt", "png", "tif", "tiff")
"""Drawings, text files of points and label images that can be opened as a scan for an atlas in the plane."""


def ask_open_path(parent: QWidget) -> Path | None:
    """The atlas to open, or None."""
    name, _ = QFileDialog.getOpenFileName(parent, "Open an atlas", "", ATLAS_FILTER)
    return Path(name) if name else None


def ask_scan_path(parent: QWidget, atlas: AtlasCard | None) -> Path | None:
    """The scan to open, or None."""
    is_flat = atlas is not None and atlas.is_flat
    what = "Drawings, points and label images" if is_flat else "Meshes, label volumes and points"
    endings = " ".join(f"*.{ending}" for ending in (OUTLINE_ENDINGS if is_flat else SCAN_ENDINGS))
    filters = f"{what} ({endings});;All files (*)"
    name, _ = QFileDialog.getOpenFileName(parent, "Open a scan", "", filters)
    return Path(name) if name else None


def ask_table_path(parent: QWidget) -> Path | None:
    """A table of scans, or None."""
    filters = "Tables (*.csv *.tsv *.txt *.xlsx);;All files (*)"
    name, _ = QFileDialog.getOpenFileName(parent, "Known covariates from a table", "", filters)
    return Path(name) if name else None


def ask_session_path(parent: QWidget) -> Path | None:
    """The session to open, or None."""
    name, _ = QFileDialog.getOpenFileName(parent, "Open a session", "", SESSION_FILTER)
    return Path(name) if name else None


def ask_session_place(parent: QWidget, state: ExplorerState) -> Path | None:
    """Where a session goes, or None; whether a file may be replaced is asked of the whole name."""
    proposal = f"{seen_stem(state, 'session')}{SESSION_ENDING}"
    unasked = QFileDialog.Option.DontConfirmOverwrite
    name, _ = QFileDialog.getSaveFileName(parent, "Save the session", proposal, SESSION_FILTER, "", unasked)
    path = Path(name)
    if not name or is_session(path):
        return path if name else None
    return path.with_name(f"{path.name}{SESSION_ENDING}")


def ask_curve_place(parent: QWidget, state: ExplorerState, ending: str) -> Path | None:
    """Where a curve goes, or None; whether a file may be replaced is asked of the whole name."""
    proposal = f"{seen_stem(state, state.curve.measure)}{ending}"
    unasked = QFileDialog.Option.DontConfirmOverwrite
    kind = f"{ending[1:].upper()} (*{ending})"
    name, _ = QFileDialog.getSaveFileName(parent, "Save the curve", proposal, kind, "", unasked)
    path = Path(name)
    if not name or path.suffix.lower() == ending:
        return path if name else None
    return path.with_name(f"{path.name}{ending}")


def ask_landmarks_path(parent: QWidget) -> Path | None:
    """The landmarks of a scan, a CSV name,x,y,z in its own coordinates, or None."""
    filters = "Landmarks: name,x,y,z (*.csv);;All files (*)"
    name, _ = QFileDialog.getOpenFileName(parent, "Landmarks of the scan", "", filters)
    return Path(name) if name else None


def ask_image_path(parent: QWidget, state: ExplorerState) -> Path | None:
    """Where a picture goes, or None; whether a file may be replaced is asked of the whole name."""
    proposal = f"{seen_stem(state, has_values=True)}{PICTURE_ENDING}"
    unasked = QFileDialog.Option.DontConfirmOverwrite
    name, _ = QFileDialog.getSaveFileName(parent, "Save a picture", proposal, "PNG (*.png)", "", unasked)
    return as_picture(Path(name)) if name else None


def as_picture(path: Path) -> Path:
    """``path`` with the ending of a picture added where it lacks: ``fig.age150`` is ``fig.age150.png``."""
    return path if path.suffix.lower() == PICTURE_ENDING else path.with_name(f"{path.name}{PICTURE_ENDING}")


def dropped(data: QMimeData) -> list[Path]:
    """The files on this machine among what was dropped."""
    return [Path(url.toLocalFile()) for url in data.urls() if url.isLocalFile()]


def is_scan(file: Path) -> bool:
    """Whether a file has the ending of what can be opened as a scan."""
    return file.name.lower().endswith(tuple(f".{ending}" for ending in (*SCAN_ENDINGS, *OUTLINE_ENDINGS)))


def is_atlas(file: Path) -> bool:
    """Whether a file has the ending of an atlas."""
    return file.suffix.lower() == ATLAS_ENDING


def is_session(file: Path) -> bool:
    """Whether a file has the ending of a session."""
    return file.suffix.lower() == SESSION_ENDING
