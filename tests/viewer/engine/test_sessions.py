"""Sessions opened again: the same fits from the same files, and a word on whatever is not the same."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from eggs import egg

from naisr_model.errors import InputError
from naisr_viewer.engine.clinic import Clinic
from naisr_viewer.engine.engine import Engine
from naisr_viewer.engine.sessions import completed, restored
from naisr_viewer.state.session import Session, session_of, state_of


@pytest.fixture
def saved(desk, file, tmp_path) -> Session:
    """The session of a fitted patient; its files are this test's own."""
    engine, _, state = desk
    session = completed(engine, session_of(state, None, (800, 600)), [state.fit.person])
    atlas = shutil.copy(session.atlas.path, tmp_path)
    scan = shutil.copy(file, tmp_path)
    (patient,) = session.patients
    patient = replace(patient, reading=replace(patient.reading, path=Path(scan)))
    return replace(session, atlas=replace(session.atlas, path=Path(atlas)), patients=(patient,))


def opened_again(session: Session, tmp_path: Path):
    engine = Engine(folder=tmp_path / "cache")
    return engine, restored(engine, Clinic(engine), session)


def test_the_same_files_give_the_same_fit(desk, saved, tmp_path):
    engine, _, state = desk
    another, found = opened_again(saved, tmp_path)
    assert found.notes == ()
    (patient,) = found.patients
    before = engine.who(state.atlas.path, state.person).fitted.fit
    after = another.who(found.card.path, patient.fit.person).fitted.fit
    np.testing.assert_allclose(after.latent, before.latent, atol=1e-5)
    again = state_of(saved, found.card, found.patients)
    assert again.values == state.values and again.layout is state.layout and again.patient == state.patient
    assert patient.fit.extent == pytest.approx(state.fit.extent, rel=1e-5)


def test_a_scan_that_has_changed_is_told(saved, tmp_path):
    egg(2.0, -1.0).export(saved.patients[0].reading.path)
    _, found = opened_again(saved, tmp_path)
    assert len(found.patients) == 1
    assert found.notes[0].startswith("s25.stl was fitted anew, and the fit is not the one that was saved")


def test_a_scan_that_is_gone_is_left_out_and_told(saved, tmp_path):
    saved.patients[0].reading.path.unlink()
    _, found = opened_again(saved, tmp_path)
    assert found.patients == () and found.notes[0].startswith("s25.stl is left out: ")
    state = state_of(saved, found.card, found.patients)
    assert state.patient is None and state.allows(state.layout)


def test_an_atlas_that_has_changed_is_told(saved, tmp_path):
    other = replace(saved, atlas=replace(saved.atlas, sha256="0" * 64), patients=())
    _, found = opened_again(other, tmp_path)
    assert found.notes == (
        "eggs.safetensors is not as it was when the session was saved: shapes may differ.",
    )


def test_an_atlas_that_is_gone_ends_it(saved, tmp_path):
    saved.atlas.path.unlink()
    with pytest.raises(InputError, match=r"needs the atlas .*eggs\.safetensors, which is not there"):
        opened_again(saved, tmp_path)


@pytest.mark.parametrize("values", [(6.0,), (6.0, 1.0, 1.0), (412.0, 1.0)])
def test_values_of_another_atlas_end_it(saved, tmp_path, values):
    session = replace(saved, state=replace(saved.state, values=values))
    with pytest.raises(InputError, match="saved with another atlas"):
        opened_again(session, tmp_path)
