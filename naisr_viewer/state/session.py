"""What is kept of a window so that it can be brought back, as frozen values."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.camera import Camera
from naisr_viewer.state.curves import FIRST_CURVE
from naisr_viewer.state.explorer import AVERAGE_KEY, ExplorerState, with_possible_layout
from naisr_viewer.state.matrix import kept_matrix
from naisr_viewer.state.patients import Named, OpenScan, Reading
from naisr_viewer.state.support import suited


@dataclass(frozen=True)
class SavedFit:
    """What was found of a patient; it is found again, and compared with this.

    Attributes:
        values: real values of all covariates.
        code: the latent code.
    """

    values: Named
    code: tuple[float, ...] = ()


@dataclass(frozen=True)
class SavedPatient:
    """A patient, by the file that is read again.

    Attributes:
        key: tells the open scans apart.
        name: what the list shows.
        reading: how the file is read.
        known: covariates that were given.
        aligned_at: covariates of the shape that it was aligned to.
        fit: what was found; None before the first fit.
    """

    key: int
    name: str
    reading: Reading
    known: Named = ()
    aligned_at: Named = ()
    fit: SavedFit | None = None


@dataclass(frozen=True)
class SavedAtlas:
    """An atlas by its file.

    Attributes:
        path: where it was.
        sha256: of its content, hexadecimal.
    """

    path: Path
    sha256: str = ""


@dataclass(frozen=True)
class Session:
    """All that was to be seen.

    Attributes:
        atlas: which was open.
        state: the rest of the situation; of its patients, and of its atlas, there is nothing in it.
        patients: those that were open.
        camera: None before the first picture.
        window_px: width and height of the window.
    """

    atlas: SavedAtlas
    state: ExplorerState
    patients: tuple[SavedPatient, ...] = ()
    camera: Camera | None = None
    window_px: tuple[int, int] = (1280, 800)


def session_of(state: ExplorerState, camera: Camera | None, window_px: tuple[int, int]) -> Session:
    """What is kept of ``state``; there is an atlas. Codes and hashes are for who knows the files to add."""
    assert state.atlas is not None
    return Session(
        SavedAtlas(state.atlas.path),
        replace(state, atlas=None, patients=(), has_norms=False, is_atlas_changed=False),
        tuple(_saved(each) for each in state.patients),
        camera,
        window_px,
    )


def state_of(session: Session, card: AtlasCard, patients: tuple[OpenScan, ...]) -> ExplorerState:
    """The situation of a session with its atlas and its patients; of who could not be read it is silent.

    So it is of covariates that the atlas, as it is now, has not.
    """
    keys, names = {each.key for each in patients}, {each.name for each in card.covariates}
    state = session.state
    return with_possible_layout(
        replace(
            state,
            atlas=card,
            patients=patients,
            matrix=kept_matrix(card, state.matrix),
            patient=state.patient if state.patient in keys else None,
            compared=state.compared if state.compared in keys | {AVERAGE_KEY} else None,
            support=suited(state.support, card),
            muted=tuple(name for name in state.muted if name in names),
            curve=state.curve if state.curve.covariate in names | {""} else FIRST_CURVE,
            touched=state.touched if state.touched in names else "",
        )
    )


def _saved(patient: OpenScan) -> SavedPatient:
    fit = None if patient.fit is None else SavedFit(patient.fit.values)
    return SavedPatient(patient.key, patient.name, patient.reading, patient.known, patient.aligned_at, fit)
