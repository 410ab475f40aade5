"""Reading an image whatever its file is called."""

from __future__ import annotations

import re
from pathlib import Path

from naisr_model.data import formats
from naisr_model.data.images.base import Image, beginning, content
from naisr_model.data.images.metaimage import read_metaimage
from naisr_model.data.images.nifti import half, read_nifti, read_pair
from naisr_model.data.images.nrrd import read_nrrd
from naisr_model.errors import InputError
from naisr_model.files import require_file

FOREIGN = {rb"(?s).{128}DICM": "a DICOM file; convert the series to NIfTI or NRRD"}
"""Images in formats that are not read, by how they begin, and what to do with them."""

_NIFTI = re.compile(rb"(?s).{344}n\+1|.{4}n\+2")
_PAIR = re.compile(rb"(?s).{344}ni1|.{4}ni2|(\x5c\x01\0\0|\0\0\x01\x5c).{344,348}\Z")
"""Of Analyze all that is known is the length of the header, in either order of bytes."""

_NRRD = re.compile(rb"NRRD\d{4}\s")
_METAIMAGE = re.compile(rb"(\s*[A-Za-z]\w*[ \t]*=[^\n]*\n)*?\s*(ObjectType|NDims)[ \t]*=")
_START_BYTES = 512


def is_image(path: str | Path) -> bool:
    """Whether a file begins as an image does, also in a format that :func:`read_image` can only name.

    Of a pair of header and image either file is one.
    """
    path = Path(path)
    start = beginning(path, _START_BYTES) if path.is_file() else b""
    known = (_NIFTI, _PAIR, _NRRD, _METAIMAGE, *map(re.compile, FOREIGN))
    return any(each.match(start) for each in known) or _header_beside(path) is not None


def read_image(path: str | Path) -> Image:
    """Read a three-dimensional image.

    Args:
        path: NIfTI or Analyze, NRRD or MetaImage, plain or gzipped; of two files that belong together the
            header, or the image of a pair.

    Raises:
        InputError: when the file is missing, damaged, cut off or too large, in another format, no single
            volume of numbers, or does not say where its voxels are.
    """
    path = require_file(path)
    start = beginning(path, _START_BYTES)
    if _NIFTI.match(start):
        return read_nifti(path.name, content(path))
    if _PAIR.match(start):
        return read_pair(path, content(path))
    if _NRRD.match(start):
        return read_nrrd(path, content(path))
    if _METAIMAGE.match(start):
        return read_metaimage(path, content(path))
    for magic, what in FOREIGN.items():
        if re.match(magic, start):
            raise InputError(f"{path.name} is {what}")
    if header := _header_beside(path):
        return read_pair(header, content(header))
    raise _not_known(path, start)


def _header_beside(path: Path) -> Path | None:
    """The header of a file that is called the image of a pair."""
    if not path.name.lower().endswith((".img", ".img.gz")):
        return None
    header = half(path, "hdr")
    return header if header and _PAIR.match(beginning(header, _START_BYTES)) else None


def _not_known(path: Path, start: bytes) -> InputError:
    what, remedy = formats.foreign(start) or ("", "")
    if what and "volume" not in what:
        return InputError(f"{path.name} is {what}; {remedy}")
    if path.name.lower().endswith((".img", ".img.gz")):
        return InputError(
            f"{path.name} is the image of a pair, and its header (.hdr) is not there or damaged"
        )
    sentence = f"{path.name} holds no NIfTI, Analyze, NRRD or MetaImage, so it is damaged, export it again"
    return InputError(f"{sentence}; if it is a mesh, give it the ending of one")
