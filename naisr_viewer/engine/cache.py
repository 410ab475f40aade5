"""What is kept between two runs of the program: nothing of it is needed, all of it saves time.

Everything is kept under a fingerprint of the atlas file and of the program, so that another file, or
another version of the program, finds nothing and computes.
"""

from __future__ import annotations

import hashlib
import json
import zipfile
import zlib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import platformdirs

import naisr_viewer
from naisr_model import errors
from naisr_model.errors import InputError
from naisr_viewer.state.explorer import AtlasCard, Population
from naisr_viewer.state.requests import Origin, SurfaceRequest, SurfaceResult

KEPT_FILES = 8
"""How many of each kind are kept, the newest ones; some MB each."""

OPENING = "opening.npz"
DISPLACEMENTS = "displacements.safetensors"
"""Endings of what is kept."""

PROGRAM = (Path(errors.__file__).parent, Path(naisr_viewer.__file__).parent)
"""The folders of the code that computes surfaces."""


def cache_folder() -> Path:
    """The user's own, where other programs keep theirs."""
    return platformdirs.user_cache_path("naisr-viewer", appauthor=False)


def fingerprint(path: Path) -> str:
    """Of the contents of an atlas file and of the program.

    Raises:
        InputError: when the file cannot be read.
    """
    try:
        contents = path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}; give the path of an atlas") from error
    return hashlib.sha256(_program_digest() + contents).hexdigest()[:32]


@lru_cache(maxsize=1)
def _program_digest() -> bytes:
    sources = sorted(file for folder in PROGRAM for file in folder.rglob("*.py"))
    return hashlib.sha256(b"".join(file.read_bytes() for file in sources)).digest()


@dataclass(frozen=True, eq=False)
class Opening:
    """All that the window shows of an atlas before a covariate is moved.

    Attributes:
        card: of the atlas.
        template: its exact surface, which every sub-plot shows while all covariates are at their centre.
    """

    card: AtlasCard
    template: SurfaceResult


def write_opening(file: Path, opening: Opening) -> None:
    """Write what :func:`read_opening` reads.

    Raises:
        OSError: when the file cannot be written.
    """
    card, template = opening.card, opening.template
    record = {
        "name": card.name,
        "population": card.population.to_json(),
        "volume_cm3": template.volume_cm3,
        "seconds": template.seconds,
    }
    np.savez(
        file,
        points_mm=template.points_mm,
        normals=template.normals,
        faces=template.faces,
        record=np.array(json.dumps(record)),
    )


def read_opening(file: Path, request: SurfaceRequest) -> Opening:
    """What :func:`write_opening` kept; the archive's checksums find out what was damaged since.

    Args:
        file: in the cache.
        request: for the exact template of the atlas that is opened.

    Raises:
        InputError: when there is no such file or it is damaged.
    """
    try:
        with file.open("rb") as handle, np.load(handle, allow_pickle=False) as arrays:
            record = json.loads(str(arrays["record"]))
            population = Population.from_json(record["population"])
            template = SurfaceResult(
                request=request,
                points_mm=arrays["points_mm"],
                normals=arrays["normals"],
                faces=arrays["faces"],
                volume_cm3=float(record["volume_cm3"]),
                seconds=float(record["seconds"]),
                origin=Origin.NETWORK,
            )
    except (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(f"{file} does not hold the opening of an atlas ({error})") from error
    card = AtlasCard(request.atlas, str(record["name"]), population.covariates, population)
    return Opening(card, template)


def forget_oldest(folder: Path, ending: str) -> None:
    """Bound what is kept.

    Raises:
        OSError: when a file cannot be removed.
    """
    kept = sorted(folder.glob(f"*.{ending}"), key=lambda file: file.stat().st_mtime)
    for old in kept[:-KEPT_FILES]:
        old.unlink(missing_ok=True)
