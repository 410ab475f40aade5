"""Sessions for the engine: what is known of files is added, and what was open is opened again."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from naisr_model.errors import InputError
from naisr_model.files import sha256_of, stamp_of
from naisr_model.progress import SILENT, Progress
from naisr_model.shipped import shipped
from naisr_viewer.engine.clinic import Clinic
from naisr_viewer.engine.engine import Engine
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.patients import Fitted, OpenScan
from naisr_viewer.state.session import SavedAtlas, SavedFit, SavedPatient, Session

SAME_CODE = 0.02
"""Two codes are the same when no number of theirs differs by a larger share of the largest one: files and
atlas are the same then, and the rest is rounding on another machine."""


@dataclass(frozen=True)
class Restored:
    """What a session has open.

    Attributes:
        session: the session.
        card: its atlas.
        patients: the scans that could be read, with their fits.
        notes: what is not as it was saved, a sentence each.
    """

    session: Session
    card: AtlasCard
    patients: tuple[OpenScan, ...]
    notes: tuple[str, ...]


def completed(engine: Engine, session: Session, persons: Sequence[int]) -> Session:
    """A session with the hash of its atlas and the codes of its patients.

    Args:
        engine: knows everyone who was fitted.
        session: what is saved.
        persons: who each of its patients is; 0 for one without a fit.

    Raises:
        InputError: when the file of the atlas is gone.
        Cancelled: when somebody has been forgotten meanwhile.
    """
    path = session.atlas.path
    patients = [
        _with_code(engine, path, each, person) for each, person in zip(session.patients, persons, strict=True)
    ]
    return replace(session, atlas=SavedAtlas(path, sha256_of(path)), patients=tuple(patients))


def _with_code(engine: Engine, path: Path, patient: SavedPatient, person: int) -> SavedPatient:
    fitted = engine.who(path, person).fitted
    if fitted is None or patient.fit is None:
        return patient
    return replace(patient, fit=replace(patient.fit, code=tuple(fitted.fit.latent.tolist())))


def restored(engine: Engine, clinic: Clinic, session: Session, progress: Progress = SILENT) -> Restored:
    """Open the atlas of a session, read its scans and fit them again: the same files give the same fits.

    A scan that cannot be read or fitted any more is told and left out, or left unfitted.

    Raises:
        InputError: when the atlas is not there, is damaged, or does not reach to where the session was.
        Cancelled: when nobody waits any more.
    """
    path, notes = _atlas_of(session.atlas)
    card = engine.card_of(path)
    _require_inside(session, card)
    patients: list[OpenScan] = []
    for saved, piece in progress.over(session.patients):
        patient, said = _read(engine, clinic, card.path, saved, piece)
        patients += [] if patient is None else [patient]
        notes += said
    return Restored(session, card, tuple(patients), tuple(notes))


def _atlas_of(saved: SavedAtlas) -> tuple[Path, list[str]]:
    """The file to open, and what is to be said of it: a shipped one may lie elsewhere on this machine."""
    found = [path for path in _places(saved.path) if path.is_file()]
    if not found:
        raise InputError(
            f"the session needs the atlas {saved.path}, which is not there; bring it back and open it again"
        )
    exact = [path for path in found if sha256_of(path) == saved.sha256]
    if exact:
        return exact[0], []
    return found[0], [f"{found[0].name} is not as it was when the session was saved: shapes may differ."]


def _places(path: Path) -> Iterator[Path]:
    yield path
    with suppress(InputError):
        yield shipped(path.name)


def _require_inside(session: Session, card: AtlasCard) -> None:
    values = session.state.values
    if len(values) != len(card.covariates):
        raise InputError(
            f"the session has {len(values)} covariates and {card.path.name} has {len(card.covariates)}; "
            "it was saved with another atlas"
        )
    for covariate, value in zip(card.covariates, values, strict=True):
        if not covariate.contains(value):
            raise InputError(
                f"the session has {covariate.name} at {covariate.format(value)}, and {card.path.name} was "
                f"made from {covariate.extent}; it was saved with another atlas"
            )


def _read(
    engine: Engine, clinic: Clinic, atlas: Path, saved: SavedPatient, progress: Progress
) -> tuple[OpenScan | None, list[str]]:
    """A patient as it was, and what is not."""
    path, written = saved.reading.path, stamp_of(saved.reading.path)
    try:
        scan = clinic.read(atlas, saved.reading, saved.aligned_at, progress.part(0.0, 0.2))
    except InputError as error:
        return None, [f"{saved.name} is left out: {error}."]
    patient = OpenScan(
        saved.key, saved.name, saved.reading, scan, saved.known, written=written, aligned_at=saved.aligned_at
    )
    if saved.fit is None:
        return patient, []
    try:
        fit, placed = clinic.fit(atlas, scan, saved.known, progress.part(0.2, 1.0))
    except InputError as error:
        return patient, [f"{saved.name} could not be fitted again: {error}."]
    notes = (
        []
        if _is_same(engine, atlas, fit, saved.fit)
        else [
            f"{saved.name} was fitted anew, and the fit is not the one that was saved: {path.name} or the "
            "program has changed."
        ]
    )
    return replace(patient, scan=placed, fit=fit), notes


def _is_same(engine: Engine, atlas: Path, fit: Fitted, saved: SavedFit) -> bool:
    fitted = engine.who(atlas, fit.person).fitted
    assert fitted is not None
    code, before = fitted.fit.latent, np.asarray(saved.code)
    return code.shape == before.shape and bool(
        np.abs(code - before).max(initial=0.0) <= SAME_CODE * np.abs(before).max(initial=0.0)
    )
