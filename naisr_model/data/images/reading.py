"""Reading an image whatever its file is called."""

from __future__ import annotations

import re
from pathlib import Path

from naisr_model.data import formats
from naisr_model.data.images.base import Image, beginning, content
from naisr_model.data.images.nifti import read_nifti
from naisr_model.data.images.nrrd import read_nrrd
from naisr_model.errors import InputError
from naisr_model.files import require_file

FOREIGN = {
    rb"(?s).{344}ni1|.{4}ni2": "one half of a pair of header and image; save it as one file, .nii or .nii.gz",
    rb"(?s).{128}DICM": "a DICOM file; convert the series to NIfTI or NRRD",
    rb"\s*(ObjectType|NDims)\s*=": "a MetaImage; save it as NIfTI or NRRD",
}
"""Images in formats that are not read, by how they begin, and what to do with them."""

_NIFTI = re.compile(rb"(?s).{344}n\+1|.{4}n\+2")
_NRRD = re.compile(rb"NRRD\d{4}\s")
_START_BYTES = 512


def is_image(path: str | Path) -> bool:
    """Whether a file begins as an image does, also in a format that :func:`read_image` can only name."""
    path = Path(path)
    start = beginning(path, _START_BYTES) if path.is_file() else b""
    return any(each.match(start) for each in (_NIFTI, _NRRD, *map(re.compile, FOREIGN)))


def read_image(path: str | Path) -> Image:
    """Read a three-dimensional image.

    Args:
        path: NIfTI in one file, or NRRD, plain or gzipped.

    Raises:
        InputError: when the file is missing, damaged, cut off or too large, in another format, no single
            volume of numbers, or does not say where its voxels are.
    """
    path = require_file(path)
    start = beginning(path, _START_BYTES)
    if _NIFTI.match(start):
        return read_nifti(path.name, content(path))
    if _NRRD.match(start):
        return read_nrrd(path, content(path))
    for magic, what in FOREIGN.items():
        if re.match(magic, start):
            raise InputError(f"{path.name} is {what}")
    raise _not_known(path, start)


def _not_known(path: Path, start: bytes) -> InputError:
    what, remedy = formats.foreign(start) or ("", "")
    if what and "volume" not in what:
        return InputError(f"{path.name} is {what}; {remedy}")
    sentence = f"{path.name} holds neither NIfTI nor NRRD, so it is damaged, export it again"
    return InputError(f"{sentence}; if it is a mesh, give it the ending of one")
