"""Patients' files as the commands take them in: repaired, aligned, and refused with a sentence."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
import SimpleITK
import trimesh
from eggs import egg

from naisr_model import cli
from naisr_model.atlas import Atlas
from naisr_model.checkpoint import load
from naisr_model.data.align import Alignment
from naisr_model.errors import InputError
from naisr_model.patients.intake import aligned, labels, read, take_in

KNOWN = ["--known", "age=6,sex=M"]
TRUE_CM3 = egg(6.0, 1.0).volume / 1000


@pytest.fixture(scope="module")
def told(egg_atlas, tmp_path_factory):
    """Runs ``naisr fit`` on a file and gives the record that it writes."""

    def run(path: Path, *words: str) -> dict:
        record = tmp_path_factory.mktemp("fit") / "fit.json"
        given = ["fit", str(path), "--atlas", str(egg_atlas), *KNOWN, *words, "--json", str(record)]
        assert cli.main(given) == 0
        return json.loads(record.read_text())

    return run


@pytest.fixture(scope="module")
def plain(told, tmp_path_factory) -> dict:
    """The fit of the egg as it lies."""
    return told(saved(egg(6.0, 1.0), tmp_path_factory.mktemp("plain") / "egg.stl"))


def saved(mesh: trimesh.Trimesh, path: Path, matrix=None) -> Path:
    mesh = mesh.copy() if matrix is None else mesh.copy().apply_transform(matrix)
    mesh.export(path)
    return path


def turned(degrees: float, shift_mm) -> np.ndarray:
    matrix = trimesh.transformations.rotation_matrix(np.radians(degrees), [1.0, 0.0, 0.0])
    matrix[:3, 3] = shift_mm
    return matrix


def label_volume(path: Path) -> Path:
    """Label 1 a small block, label 2 the egg, in voxels of 1 mm; NRRD can name it."""
    z, y, x = np.mgrid[-45:46, -30:31, -30:31]
    half_mm = np.abs(egg(6.0, 1.0).bounds[0])
    inside = (x / half_mm[0]) ** 2 + (y / half_mm[1]) ** 2 + (z / half_mm[2]) ** 2 < 1
    labels = 2 * inside.astype(np.uint8)
    labels[:4, :4, :4] = 1
    image = SimpleITK.GetImageFromArray(labels)
    image.SetOrigin((-30.0, -30.0, -45.0))
    for key, value in {"LabelValue": "2", "Name": "egg"}.items():
        image.SetMetaData(f"Segment0_{key}", value)
    SimpleITK.WriteImage(image, str(path))
    return path


def test_a_sound_file_is_fitted_as_it_lies(plain):
    patient = plain["patient"]
    assert patient["source"] == "egg.stl, 1,280 faces"
    assert patient["repairs"] == [] and patient["alignment"] is None
    assert np.array_equal(patient["file_to_atlas"], np.eye(4))
    assert plain["volume_cm3"] == pytest.approx(TRUE_CM3, rel=0.05)


def test_metres_are_repaired_and_said_so(told, plain, tmp_path, capsys):
    record = told(saved(egg(6.0, 1.0), tmp_path / "m.stl", np.diag([1e-3, 1e-3, 1e-3, 1])))
    assert record["volume_cm3"] == pytest.approx(plain["volume_cm3"], rel=0.01)
    (repair,) = record["patient"]["repairs"]
    assert "look like metres" in repair and "scale it by 1000" in repair
    assert np.allclose(record["patient"]["file_to_atlas"], np.diag([1000, 1000, 1000, 1]))
    said = capsys.readouterr().err
    assert "naisr: read m.stl" in said and repair in said


def test_a_stated_unit_is_not_guessed(told, plain, tmp_path, egg_atlas, capsys):
    path = saved(egg(6.0, 1.0), tmp_path / "odd.stl", np.diag([0.5, 0.5, 0.5, 1]))
    record = told(path, "--scale", "2")
    assert record["volume_cm3"] == pytest.approx(plain["volume_cm3"], rel=0.01)
    assert record["patient"]["repairs"] == []
    assert cli.main(["fit", str(path), "--atlas", str(egg_atlas), "--scale", "2000"]) == 2
    assert "scale it to millimetres" in capsys.readouterr().err


def test_a_small_part_in_a_stated_unit_is_no_mistake(told, tmp_path):
    points = egg(6.0, 1.0).sample(20_000, seed=0)
    np.savetxt(tmp_path / "tip.xyz", points[points[:, 2] > 31.5])
    remarks = told(tmp_path / "tip.xyz", "--scale", "1")["patient"]["remarks"]
    assert any("check that it is this anatomy" in remark for remark in remarks)


def test_icp_brings_a_moved_scan_home(told, plain, tmp_path, capsys):
    moved = saved(egg(6.0, 1.0), tmp_path / "moved.stl", turned(20, [15, -10, 400]))
    record = told(moved, "--align", "icp")
    alignment = record["patient"]["alignment"]
    assert alignment["method"] == "icp" and alignment["after_mm"] < 1.5 < 300 < alignment["before_mm"]
    assert record["volume_cm3"] == pytest.approx(plain["volume_cm3"], rel=0.05)
    assert f"{alignment['before_mm']:.2f} mm before" in capsys.readouterr().err
    home = trimesh.load_mesh(moved).apply_transform(np.array(record["patient"]["file_to_atlas"]))
    assert np.abs(home.centroid).max() < 2


@pytest.mark.parametrize("label", ["2", "egg"])
def test_a_label_volume_will_do(told, plain, tmp_path, label):
    record = told(label_volume(tmp_path / "scan.nrrd"), "--label", label)
    assert record["patient"]["source"] == "scan.nrrd, label 2 'egg'"
    assert record["volume_cm3"] == pytest.approx(plain["volume_cm3"], rel=0.05)


def test_one_of_several_labels_must_be_chosen(egg_atlas, tmp_path, capsys):
    path = label_volume(tmp_path / "scan.nii.gz")
    for words, message in ([], "has 2 labels"), (["--label", "nose"], "has no label nose; it has 1: 0.064"):
        assert cli.main(["fit", str(path), "--atlas", str(egg_atlas), *words]) == 2
        assert message in capsys.readouterr().err


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
    assert not far.is_ready and [finding.topic for finding in far.findings] == ["far"]
    assert "align it to the atlas" in far.remarks[0]
    assert aligned(far, atlas, {"age": 6.0}, "none") is far
    home = aligned(far, atlas, {"age": 6.0}, "icp")
    assert home.is_ready and home.findings == () and home.method == "icp"
    assert home.proposal is not None and home.proposal.turned_deg < 20
    assert any("fits nearly as well" in remark for remark in home.remarks), "an egg turned over is an egg"
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


def test_points_and_a_part_will_do(told, plain, tmp_path):
    points = tmp_path / "points.csv"
    np.savetxt(points, egg(6.0, 1.0).sample(400, seed=0), delimiter=",", header="x,y,z", comments="")
    part = egg(6.0, 1.0)
    part.update_faces(part.triangles_center[:, 2] < 15)
    for path in (points, saved(part, tmp_path / "part.ply")):
        for words in ([], ["--align", "icp"]):
            record = told(path, *words)
            assert record["volume_cm3"] == pytest.approx(plain["volume_cm3"], rel=0.08)
    assert any("the surface is open" in remark for remark in record["patient"]["remarks"])


def test_transfer_and_evolve_take_the_same_way_in(egg_atlas, tmp_path, capsys):
    path = saved(egg(6.0, 1.0), tmp_path / "moved.stl", turned(0, [0, 0, 300]))
    for command in (["transfer", "--to", "age=8"], ["evolve", "--to", "8", "--steps", "2"]):
        target = tmp_path / "record.json"
        given = [str(path), "--atlas", str(egg_atlas), *KNOWN, "--align", "icp", "--json", str(target)]
        assert cli.main([command[0], *given, *command[1:]]) == 0
        record = json.loads(target.read_text())
        assert record["patient"]["alignment"]["before_mm"] > 200
        assert [shape["age"] for shape in record["shapes"]] == pytest.approx([6, 8])
        assert "aligned by icp" in capsys.readouterr().err


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
    assert len(intake.repairs) == 1 and "landmarks 0.00 mm apart" in intake.sentences[2]


@pytest.mark.parametrize(
    ("matrix", "words", "message"),
    [
        (turned(0, [0, 0, 500]), [], "far.stl: the shape lies 5"),
        (np.diag([3.0, 3.0, 3.0, 1.0]), ["--scale", "1"], "the atlas's shapes are up to"),
        (np.eye(4), ["--scale", "-1"], "the scale is -1"),
        (np.eye(4), ["--align", "landmarks"], "--landmarks FILE.csv) need each other; give both"),
        (np.eye(4), ["--label", "2"], "is no label volume"),
        (np.eye(4), ["--align", "magic"], "magic"),
        (np.diag([1.0, 1.0, 1e-9, 1.0]), [], "flat"),
    ],
)
def test_what_cannot_be_fitted_ends_with_one_sentence(egg_atlas, tmp_path, matrix, words, message, capsys):
    path = saved(egg(6.0, 1.0), tmp_path / "far.stl", matrix)
    assert cli.main(["fit", str(path), "--atlas", str(egg_atlas), *words]) == 2
    said = capsys.readouterr().err.strip()
    assert message in said and said.startswith("naisr: ") and said.count("\n") == 0


def test_landmarks_need_an_atlas_that_knows_them(egg_atlas, tmp_path, capsys):
    path = saved(egg(6.0, 1.0), tmp_path / "egg.stl")
    landmarks = tmp_path / "landmarks.csv"
    landmarks.write_text("name,x,y,z\ntip,0,0,32\n")
    words = ["--align", "landmarks", "--landmarks", str(landmarks)]
    assert cli.main(["fit", str(path), "--atlas", str(egg_atlas), *words]) == 2
    assert "not aligned by landmarks; choose icp or none" in capsys.readouterr().err
