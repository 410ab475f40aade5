"""Pictures of the window as files."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QBuffer, QIODevice
from PySide6.QtGui import QImage, QImageWriter

from naisr_model.errors import InputError
from naisr_model.files import replacing


def write_picture(path: Path, image: QImage) -> None:
    """Write a picture; the ending of ``path`` says which kind.

    Raises:
        InputError: for an ending that is of no picture, or when the file cannot be written.
    """
    content = _encoded(path, image)
    with replacing(path) as temporary:
        temporary.write_bytes(content)


def _encoded(path: Path, image: QImage) -> bytes:
    """The contents of the file; Qt would not say what keeps it from being written."""
    content = QBuffer()
    content.open(QIODevice.OpenModeFlag.WriteOnly)
    if not QImageWriter(content, path.suffix[1:].encode() or b"none").write(image):
        raise InputError(f"cannot write a picture to {path}; end its name with .png")
    return bytes(content.data().data())
