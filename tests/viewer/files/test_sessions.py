"""Sessions as files: all that is seen comes back, and what is no session is refused in a sentence."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest

from naisr_model.errors import InputError
from naisr_viewer.files.sessions import read_session, write_session
from naisr_viewer.state.camera import Camera
from naisr_viewer.state.curves import CurveChoice
from naisr_viewer.state.drawer import Tab
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.layouts import Layout
from naisr_viewer.state.overlay import Overlay, Quantity
from naisr_viewer.state.patients import Reading
from naisr_viewer.state.pins import Pin
from naisr_viewer.state.section import Plane, Section
from naisr_viewer.state.session import SavedAtlas, SavedFit, SavedPatient, Session
from naisr_viewer.state.support import Support

BESIDE = {"atlas", "patients", "has_norms", "is_atlas_changed"}
"""Fields of a state that a session has elsewhere, or not."""


def everything(folder: Path) -> Session:
    reading = Reading(folder / "scans" / "p 1.nrrd", "egg", 10.0, "landmarks", Path("/elsewhere/lm.csv"))
    return Session(
        SavedAtlas(folder / "eggs.safetensors", "0f" * 32),
        ExplorerState(
            values=(6.25, -1.0),
            layout=Layout.CHANGE,
            follow=True,
            patient=2,
            compared=1,
            has_ghost=False,
            pins=(Pin(2, (0.1, -2.0, 3.5)),),
            section=Section(Plane.FREE, (0.6, 0.0, -0.8), -12.5, True),
            has_edges=True,
            drawer=Tab.POINT,
            overlay=Overlay(Quantity.RATE, (("mm per kg", 0.25),), is_shared=False),
            muted=("sex",),
            touched="age",
            support=Support("sex", "age", True),
            curve=CurveChoice("length", "sex"),
        ),
        (
            SavedPatient(1, "a", Reading(folder / "a.stl", 3)),
            SavedPatient(2, "ü", reading, (("age", 6.0),), (), SavedFit((("age", 6.0),), (0.5, -1e-9))),
        ),
        Camera((1.0, 2.0, 3.0), (0.0, 0.0, 0.5), (0.0, 0.0, 1.0), (40.0, 90.0), 0.7),
        (1024, 600),
    )


def test_all_that_is_seen_comes_back(tmp_path):
    session, file = everything(tmp_path), tmp_path / "s.json"
    write_session(session, file)
    assert read_session(file) == session


def test_no_field_of_the_state_is_forgotten(tmp_path):
    write_session(everything(tmp_path), tmp_path / "s.json")
    record = json.loads((tmp_path / "s.json").read_text())
    assert set(record["state"]) == {field.name for field in dataclasses.fields(ExplorerState)} - BESIDE


def test_a_folder_with_a_session_and_its_files_can_be_moved(tmp_path):
    (tmp_path / "here").mkdir()
    write_session(everything(tmp_path / "here"), tmp_path / "here" / "s.json")
    (tmp_path / "here").rename(tmp_path / "there")
    moved = read_session(tmp_path / "there" / "s.json")
    assert moved.atlas.path == tmp_path / "there" / "eggs.safetensors"
    assert moved.patients[1].reading.landmarks == Path("/elsewhere/lm.csv")


def damaged(path: Path, *keys: str | int, value: object) -> Path:
    """A good session with one entry replaced."""
    write_session(everything(path.parent), path)
    record = json.loads(path.read_text())
    inner = record
    for key in keys[:-1]:
        inner = inner[key]
    inner[keys[-1]] = value
    path.write_text(json.dumps(record))
    return path


@pytest.mark.parametrize(
    ("keys", "value"),
    [
        (("state", "values"), ["x", 1.0]),
        (("state", "values"), [float("nan"), 1.0]),
        (("state", "layout"), "upside down"),
        (("state", "pins"), [{"number": 1}]),
        (("state",), []),
        (("patients", 0, "reading", "path"), 7),
        (("patients", 0, "reading", "label"), 1.5),
        (("patients", 0, "key"), None),
        (("atlas",), {}),
        (("camera", "zoom"), "near"),
        (("camera", "up"), [0.0, 1.0]),
        (("camera", "up"), [1.0, 2.0, 2.5]),
        (("camera", "position_mm"), [0.0, 0.0, 0.5]),
        (("camera", "zoom"), 0.0),
        (("camera", "framed_mm"), [40.0, -1.0]),
        (("state", "overlay", "limits"), [["mm", 0.0]]),
        (("state", "pins", 0, "origin_mm"), [1e300, 0.0, 0.0]),
        (("state", "section", "normal"), [1.0, 1.0, 0.0]),
        (("state", "section", "plane"), "oblique"),
        (("atlas", "path"), "a" * 300),
        (("atlas", "path"), "a/" * 2500),
        (("window_px",), [1]),
    ],
)
def test_a_damaged_session_is_named_and_refused(tmp_path, keys, value):
    with pytest.raises(InputError, match=r"^s\.json is a damaged session: .*; save it again$") as told:
        read_session(damaged(tmp_path / "s.json", *keys, value=value))
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("content", [b"{", b"[]", b"\xff\xfe\x00", b'{"format": "other"}', b"7", b"[" * 9000])
def test_what_is_no_session_is_refused(tmp_path, content):
    (tmp_path / "s.json").write_bytes(content)
    with pytest.raises(InputError, match="is no session"):
        read_session(tmp_path / "s.json")


def test_a_session_of_a_newer_program_is_refused(tmp_path):
    with pytest.raises(InputError, match="newer program"):
        read_session(damaged(tmp_path / "s.json", "version", value=2))


def test_nothing_and_a_folder_are_no_sessions(tmp_path):
    with pytest.raises(InputError):
        read_session(tmp_path / "absent.json")
    with pytest.raises(InputError, match="folder"):
        read_session(tmp_path)
