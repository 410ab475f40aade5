"""A patient's file on its way into the frame of an atlas, step by step."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from eggs import egg, label_volume, saved, turned

from naisr_model.atlas import Atlas
from naisr_model.checkpoint import load
from naisr_model.data.align import Alignment
from naisr_model.errors import Cancelled, InputError
from naisr_model.patients.intake import Intake, aligned, labels, read, take_in
from naisr_model.progress import Progress

TRUE_CM3 = egg(6.0, 1.0).volume / 1000


def test_labels_can_be_listed_before_one_is_read(egg_atlas, tmp_path):
    path = label_volume(tmp_path / "scan.nrrd")
    titles = labels(path)
    assert titles is not None and titles[1] == "1: 0.064 cm³" and titles[2].startswith("2 'egg': 58.")
    assert labels(saved(egg(6.0, 1.0), tmp_path / "egg.stl")) is None
    intake = read(path, Atlas.load(egg_atlas), label=2)
    assert intake.is_ready and intake.proposal is None
    assert intake.patient.volume_cm3 == pytest.approx(TRUE_CM3, rel=0.01)
    assert intake.to_json()["volume_cm3"] == intake.patient.volume_cm3
    (tmp_path / "bad.nrrd").write_bytes(b"NRRD0004\n")
    with pytest.raises(InputError, match=r"bad\.nrrd"):
        labels(tmp_path / "bad.nrrd")


def test_a_person_may_look_before_aligning(egg_atlas, tmp_path):
    atlas, path = Atlas.load(egg_atlas), saved(egg(6.0, 1.0), tmp_path / "far.stl", turned(0, [0, 0, 400]))
    far = read(path, atlas)
    assert not far.is_ready and [remark.topic for remark in far.found] == ["far"]
    assert "align it to the atlas" in far.remarks[0].text
    assert aligned(far, atlas, {"age": 6.0}, "none") is far
    home = aligned(far, atlas, {"age": 6.0}, "icp")
    assert home.is_ready and home.found == () and home.method == "icp"
    assert home.proposal is not None and home.proposal.turned_deg < 20
    assert any("fits nearly as well" in remark.text for remark in home.remarks), (
        "an egg turned over is an egg"
    )
    assert home.proposal is not None and home.proposal.after_mm < 1.5 < 300 < home.proposal.before_mm
    assert np.array_equal(far.patient.from_file, np.eye(4)), "the proposal can still be declined"
    whole = take_in(path, atlas, {"age": 6.0}, align="icp")
    assert np.array_equal(whole.patient.from_file, home.patient.from_file)
    assert whole.sentences == home.sentences


def test_an_open_surface_has_no_volume_of_its_own(egg_atlas, tmp_path):
    part = egg(6.0, 1.0)
    part.update_faces(part.triangles_center[:, 2] < 15)
    intake = read(saved(part, tmp_path / "part.ply"), Atlas.load(egg_atlas))
    assert intake.is_ready and not intake.patient.is_closed and intake.patient.volume_cm3 is None
    assert "volume" not in intake.sentences[-1].split(";")[0]


def test_landmarks_follow_the_repairs(egg_atlas, tmp_path):
    ends = {"top": (0.0, 0.0, 32.0), "side": (22.0, 0.0, 0.0), "front": (0.0, 20.0, 0.0)}
    checkpoint = dataclasses.replace(load(egg_atlas), alignment=Alignment("landmarks", "", ends))
    in_metres = turned(70, [5, 20, 300])
    in_metres[:3] /= 1000
    path, landmarks = saved(egg(6.0, 1.0), tmp_path / "egg.stl", in_metres), tmp_path / "landmarks.csv"
    rows = [(name, *(in_metres @ [*point, 1])[:3]) for name, point in ends.items()]
    landmarks.write_text("name,x,y,z\n" + "".join(f"{n},{x},{y},{z}\n" for n, x, y, z in rows))
    intake = take_in(path, Atlas(checkpoint), {"age": 6.0}, align="landmarks", landmarks=landmarks)
    assert np.allclose(intake.patient.from_file @ in_metres, np.eye(4), atol=1e-6)
    assert intake.proposal is not None and intake.proposal.landmarks_mm == pytest.approx(0, abs=1e-6)
    assert [remark.severity for remark in intake.remarks] == [
        "fine"
    ] and "landmarks 0.00 mm apart" in intake.sentences[2]


def test_landmarks_of_another_scan_that_make_it_worse_are_told_of(egg_atlas, tmp_path):
    ends = {"top": (0.0, 0.0, 32.0), "side": (22.0, 0.0, 0.0), "front": (0.0, 20.0, 0.0)}
    atlas = Atlas(dataclasses.replace(load(egg_atlas), alignment=Alignment("landmarks", "", ends)))
    path, landmarks = saved(egg(6.0, 1.0), tmp_path / "egg.stl", turned(0, [0, 0, 8])), tmp_path / "marks.csv"

    def given(motion) -> Intake:
        rows = [(name, *(motion @ [*point, 1])[:3]) for name, point in ends.items()]
        landmarks.write_text("name,x,y,z\n" + "".join(f"{n},{x},{y},{z}\n" for n, x, y, z in rows))
        return take_in(path, atlas, {"age": 6.0}, align="landmarks", landmarks=landmarks)

    assert "worse" not in [remark.topic for remark in given(turned(0, [0, 0, 8])).remarks]
    other = given(turned(50, [0, 0, -20]))
    (worse,) = [remark for remark in other.remarks if remark.topic == "worse"]
    assert worse.severity == "look" and "are of this scan" in worse.remedy and other.proposal is not None
    ends_mm = f"{other.proposal.before_mm:.1f} mm before, {other.proposal.after_mm:.1f} mm after"
    assert worse.sentence == f"the alignment made it worse: {ends_mm}"


def test_an_alignment_tells_how_far_it_is_and_can_be_stopped(egg_atlas, tmp_path):
    atlas, path = Atlas.load(egg_atlas), saved(egg(6.0, 1.0), tmp_path / "far.stl", turned(0, [0, 0, 400]))
    told: list[float] = []
    take_in(path, atlas, {"age": 6.0}, align="icp", progress=Progress(told.append))
    assert told == sorted(told) and told[-1] == 1.0
    with pytest.raises(Cancelled):
        take_in(path, atlas, {}, align="icp", progress=Progress(is_unwanted=lambda: True))


@pytest.mark.parametrize("scale", [0.0, -1.0, 1e13, 1e300, float("inf"), float("nan")])
def test_a_scale_of_no_unit_is_refused(egg_atlas, tmp_path, scale):
    with pytest.raises(InputError, match=r"the scale is .*; give the millimetres per unit of the file"):
        read(saved(egg(6.0, 1.0), tmp_path / "egg.stl"), Atlas.load(egg_atlas), scale=scale)


def test_a_volume_of_another_unit_than_it_states_is_read_once_the_unit_is_told(egg_atlas, tmp_path):
    path = label_volume(tmp_path / "scan.nrrd")
    content = path.read_bytes()
    start, mark, rest = content.partition(b"\nspace:")
    assert mark
    path.write_bytes(start + b'\nspace units: "m" "m" "m"' + mark + rest)
    atlas = Atlas.load(egg_atlas)
    found = read(path, atlas, label=2)
    assert not found.is_ready and found.found[0].topic == "units"
    assert "look like millimetres" in found.found[0].sentence
    told = read(path, atlas, label=2, scale=1.0)
    assert told.is_ready and told.patient.volume_cm3 == pytest.approx(TRUE_CM3, rel=0.01)
