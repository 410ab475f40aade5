"""What is kept between two runs of the program: nothing of it is needed, all of it saves time.

Everything is kept under a fingerprint of the atlas file and of the program, so that another file, or
another version of the program, finds nothing and computes. A cache that fails costs time, no more.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import zipfile
import zlib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import platformdirs

import naisr_viewer
from naisr_model import errors
from naisr_model.capabilities import Capabilities
from naisr_model.covariates import Population
from naisr_model.errors import InputError
from naisr_model.files import replacing, sha256_of, sources_digest
from naisr_model.frames import Frame
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.layouts import FULL_SHAPE, TEMPLATE
from naisr_viewer.state.requests import EXACT_RESOLUTION, Origin, SurfaceRequest, SurfaceResult

if TYPE_CHECKING:
    from naisr_model.atlas import Atlas
    from naisr_model.measures.norms import Norms
    from naisr_model.surface.displacements import DisplacementTables

KEPT_FILES = 8
"""How many of each kind are kept, the newest ones; some MB each."""

OPENING = "opening.npz"
DISPLACEMENTS = "displacements.safetensors"
NORMS = "norms.safetensors"
"""Endings of what is kept."""

PROGRAM = (Path(errors.__file__).parent, Path(naisr_viewer.__file__).parent)
"""The folders of the code that computes surfaces."""


def cache_folder() -> Path:
    """The user's own, where other programs keep theirs."""
    return platformdirs.user_cache_path("naisr-viewer", appauthor=False)


def fingerprint_of(path: Path) -> str:
    """Of the contents of an atlas file and of the program.

    Raises:
        InputError: when the file cannot be read.
    """
    return hashlib.sha256(program_digest() + sha256_of(path, "an atlas").encode()).hexdigest()[:32]


@lru_cache(maxsize=1)
def program_digest() -> bytes:
    """Of the code that computes surfaces."""
    return sources_digest(*PROGRAM)


@dataclass(frozen=True, eq=False)
class Opening:
    """All that the window shows of an atlas before a covariate is moved.

    Attributes:
        card: of the atlas.
        picture: the answer to :func:`first_picture`.
    """

    card: AtlasCard
    picture: SurfaceResult


def first_picture(atlas: AtlasCard) -> SurfaceRequest:
    """What every sub-plot shows before a covariate is moved, and all previews are made of."""
    if atlas.capabilities.vanishes_at_centre:
        return SurfaceRequest(atlas.path, TEMPLATE, (), EXACT_RESOLUTION)
    names = [covariate.name for covariate in atlas.covariates]
    start = tuple(zip(names, atlas.start, strict=True))
    return SurfaceRequest(atlas.path, FULL_SHAPE, start, EXACT_RESOLUTION)


class Cache:
    """Of one user.

    Args:
        folder: where it is; made when it is missing.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def opening(self, fingerprint: str, path: Path) -> Opening | None:
        """Of the atlas file ``path``, or None where nothing of use is kept."""
        with contextlib.suppress(InputError):
            return _read_opening(self._file(fingerprint, OPENING), path)
        return None

    def keep_opening(self, fingerprint: str, opening: Opening) -> None:
        """For the next run."""
        with contextlib.suppress(InputError, OSError):
            with replacing(self._file(fingerprint, OPENING)) as temporary:
                _write_opening(temporary, opening)
            self._forget_oldest(OPENING)

    def tables(self, fingerprint: str) -> DisplacementTables | None:
        """Tabulated displacements of the population average, or None where none of use are kept."""
        from naisr_model.surface.displacements import DisplacementTables

        with contextlib.suppress(InputError):
            return DisplacementTables.load(self._file(fingerprint, DISPLACEMENTS))
        return None

    def keep_tables(self, fingerprint: str, tables: DisplacementTables) -> None:
        """For the next run."""
        with contextlib.suppress(InputError, OSError):
            tables.save(self._file(fingerprint, DISPLACEMENTS))
            self._forget_oldest(DISPLACEMENTS)

    def norms(self, fingerprint: str, atlas: Atlas) -> Norms | None:
        """What is usual among the people of an atlas, or None where nothing of use is kept."""
        from naisr_model.measures.kept import load_norms

        with contextlib.suppress(InputError):
            return load_norms(self._file(fingerprint, NORMS), atlas)
        return None

    def keep_norms(self, fingerprint: str, norms: Norms) -> None:
        """For the next run."""
        from naisr_model.measures.kept import save_norms

        with contextlib.suppress(InputError, OSError):
            save_norms(norms, self._file(fingerprint, NORMS))
            self._forget_oldest(NORMS)

    def _file(self, fingerprint: str, ending: str) -> Path:
        return self._folder / f"{fingerprint}.{ending}"

    def _forget_oldest(self, ending: str) -> None:
        """Bound what is kept."""
        kept = sorted(self._folder.glob(f"*.{ending}"), key=lambda file: file.stat().st_mtime)
        for old in kept[:-KEPT_FILES]:
            old.unlink(missing_ok=True)


def _write_opening(file: Path, opening: Opening) -> None:
    card, picture = opening.card, opening.picture
    record = {
        "name": card.name,
        "population": card.population.to_json(),
        "capabilities": dataclasses.asdict(card.capabilities),
        "frame": card.frame.to_json(),
        "extent": picture.extent,
        "seconds": picture.seconds,
    }
    np.savez(
        file,
        points_mm=picture.points_mm,
        normals=picture.normals,
        faces=picture.faces,
        record=np.array(json.dumps(record)),
    )


def _require_surface(picture: SurfaceResult, dim: int) -> None:
    """Make sure that a surface or a curve can be drawn: whoever draws it asks no more.

    Raises:
        ValueError: when it is none.
    """
    points, normals, faces = picture.points_mm, picture.normals, picture.faces
    arrays = [array.ndim == 2 and array.shape[1] == dim for array in (points, normals, faces)]
    if not all(arrays) or len(points) != len(normals) or not np.isfinite(points).all():
        raise ValueError("its points are none")
    if faces.size and not 0 <= faces.min() <= faces.max() < len(points):
        raise ValueError("its faces are of other points")


def _read_opening(file: Path, atlas: Path) -> Opening:
    """What :func:`_write_opening` kept; the archive's checksums find out what was damaged since.

    Raises:
        InputError: when there is no such file or it is damaged.
    """
    try:
        with file.open("rb") as handle, np.load(handle, allow_pickle=False) as arrays:
            record = json.loads(str(arrays["record"]))
            population = Population.from_json(record["population"])
            capabilities = Capabilities(**record["capabilities"])
            frame = Frame.from_json(record["frame"])
            name, covariates = str(record["name"]), population.covariates
            card = AtlasCard(atlas, name, covariates, population, capabilities, frame)
            picture = SurfaceResult(
                request=first_picture(card),
                points_mm=arrays["points_mm"],
                normals=arrays["normals"],
                faces=arrays["faces"],
                extent=float(record["extent"]),
                seconds=float(record["seconds"]),
                origin=Origin.NETWORK,
            )
        _require_surface(picture, card.frame.dim)
    except (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(f"{file} does not hold the opening of an atlas ({error})") from error
    return Opening(card, picture)
