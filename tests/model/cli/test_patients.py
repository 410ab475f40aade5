"""Patients' files as the commands take them in: repaired, aligned, and refused with a sentence."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
import pyvista
import trimesh
from eggs import egg, label_volume, saved, turned

from naisr_model import cli
from naisr_model.atlas import Alternative, Atlas, Fit
from naisr_model.exports import mesh_bytes

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


def test_a_sound_file_is_fitted_as_it_lies(plain):
    patient = plain["patient"]
    assert patient["source"] == "egg.stl, 1,280 faces"
    assert patient["remarks"] == [] and patient["alignment"] is None
    assert np.array_equal(patient["file_to_atlas"], np.eye(4))
    assert plain["volume_cm3"] == pytest.approx(TRUE_CM3, rel=0.05)


def test_metres_are_repaired_and_said_so(told, plain, tmp_path, capsys):
    record = told(saved(egg(6.0, 1.0), tmp_path / "m.stl", np.diag([1e-3, 1e-3, 1e-3, 1])))
    assert record["volume_cm3"] == pytest.approx(plain["volume_cm3"], rel=0.01)
    (remark,) = record["patient"]["remarks"]
    assert (remark["severity"], remark["topic"]) == ("fine", "units")
    assert "look like metres" in remark["sentence"] and "was scaled by 1000" in remark["sentence"]
    assert np.allclose(record["patient"]["file_to_atlas"], np.diag([1000, 1000, 1000, 1]))
    said = capsys.readouterr().err
    assert "naisr: read m.stl" in said and f"naisr: fine: {remark['sentence']}" in said


def test_a_stated_unit_is_not_guessed(told, plain, tmp_path, egg_atlas, capsys):
    path = saved(egg(6.0, 1.0), tmp_path / "odd.stl", np.diag([0.5, 0.5, 0.5, 1]))
    record = told(path, "--scale", "2")
    assert record["volume_cm3"] == pytest.approx(plain["volume_cm3"], rel=0.01)
    assert record["patient"]["remarks"] == []
    assert cli.main(["fit", str(path), "--atlas", str(egg_atlas), "--scale", "2000"]) == 2
    assert "scale it to millimetres" in capsys.readouterr().err


def test_a_small_part_in_a_stated_unit_is_no_mistake(told, tmp_path):
    points = egg(6.0, 1.0).sample(20_000, seed=0)
    np.savetxt(tmp_path / "tip.xyz", points[points[:, 2] > 31.5])
    remarks = told(tmp_path / "tip.xyz", "--scale", "1")["patient"]["remarks"]
    assert any("check that it is this anatomy" in remark["remedy"] for remark in remarks)


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


def test_points_and_a_part_will_do(told, plain, tmp_path):
    points = tmp_path / "points.csv"
    np.savetxt(points, egg(6.0, 1.0).sample(400, seed=0), delimiter=",", header="x,y,z", comments="")
    part = egg(6.0, 1.0)
    part.update_faces(part.triangles_center[:, 2] < 15)
    for path in (points, saved(part, tmp_path / "part.ply")):
        for words in ([], ["--align", "icp"]):
            record = told(path, *words)
            assert record["volume_cm3"] == pytest.approx(plain["volume_cm3"], rel=0.08)
    assert any("the surface is open" in remark["sentence"] for remark in record["patient"]["remarks"])


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


@pytest.fixture(scope="module")
def patient(egg_atlas, tmp_path_factory) -> Path:
    """A shape that the atlas makes itself, at known covariates and a known code."""
    atlas, path = Atlas.load(egg_atlas), tmp_path_factory.mktemp("patient") / "scan.stl"
    atlas.shape({"age": 6.5, "sex": 1.0}, atlas.checkpoint.latents[3], 64).export(path)
    return path


def test_the_command_tells_what_python_tells(egg_atlas, patient, tmp_path, capsys):
    target = tmp_path / "fit.json"
    assert cli.main(["fit", str(patient), "--atlas", str(egg_atlas), "--json", str(target)]) == 0
    said, record = capsys.readouterr().out, json.loads(target.read_text())
    fit = Atlas.load(egg_atlas).fit(trimesh.load_mesh(patient))
    assert record["covariates"]["age"] == pytest.approx(fit.covariates["age"], abs=0.1)
    assert record["intervals"].keys() == {"age", "sex"} and record["inferred"] == ["age", "sex"]
    assert record["lasting"] == fit.lasting
    assert record["volume_interval_cm3"][0] < record["volume_cm3"] < record["volume_interval_cm3"][1]
    assert f"volume: {record['volume_cm3']:.1f} cm³" in said and "residual:" in said


def test_the_report_of_a_fit_reads_as_people_write(egg_atlas, patient, monkeypatch, capsys):
    told = Alternative({"age": 3.98765, "sex": -1.0}, 0.42)
    monkeypatch.setattr(Fit, "alternatives", (told, told))
    monkeypatch.setattr(Fit, "intervals", {"age": (3.0, 5.5), "sex": (-1.0, 1.0)})
    assert cli.main(["fit", str(patient), "--atlas", str(egg_atlas)]) == 0
    said = capsys.readouterr().out
    assert "(3 to 5.5 years)" in said and "(F or M)" in said
    assert "or, with a probability of 42 %: 3.988 years, F\n" in said


def test_transfer_and_evolve_write_shapes_and_tables(egg_atlas, patient, tmp_path, capsys):
    given = [str(patient), "--atlas", str(egg_atlas), "--known", "age=6.5,sex=M", "--out", str(tmp_path)]
    assert cli.main(["transfer", *given, "--to", "age=8"]) == 0
    said = capsys.readouterr().out
    assert "8 years, M:" in said
    assert "at other covariates 90 % of what sets" in said  # nobody was seen twice
    assert len((tmp_path / "volumes.csv").read_text().splitlines()) == 3
    ways = ["--from", "3", "--to", "4", "--steps", "3", "--path", "only"]
    assert cli.main(["evolve", *given, *ways]) == 0
    assert len(list(tmp_path.glob("shape*.stl"))) == 3


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["fit", "PATIENT", "--known", "age"], "'age' after --known is not understood"),
        (["fit", "PATIENT", "--known", "height=3"], "unknown covariate 'height'"),
        (["fit", "nowhere.stl"], "nowhere.stl"),
        (["transfer", "PATIENT", "--to", "age=99"], "the atlas was trained on 1 to"),
        (["evolve", "PATIENT", "--along", "height"], "unknown covariate 'height'"),
        (["evolve", "PATIENT", "--path", "nowhere.csv"], "the path nowhere.csv cannot be read"),
    ],
)
def test_what_a_command_cannot_use_gets_a_sentence(egg_atlas, patient, words, message, capsys):
    given = [str(patient) if word == "PATIENT" else word for word in words]
    assert cli.main([*given, "--atlas", str(egg_atlas)]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    "words",
    [
        ["fit", "PATIENT", "--known", "age=99"],
        ["transfer", "PATIENT", "--to", "age=99"],
        ["evolve", "PATIENT", "--to", "99", "--path", "only"],
        ["evolve", "PATIENT", "--to", "99"],
    ],
)
def test_a_refusal_recommends_no_option_that_the_command_lacks(egg_atlas, patient, words, capsys):
    given = [str(patient) if word == "PATIENT" else word for word in words]
    assert cli.main([*given, "--atlas", str(egg_atlas)]) == 2
    said = capsys.readouterr().err
    assert cli.main([words[0], "--help"]) == 0
    there = capsys.readouterr().out
    assert "give a value within that" in said
    assert all(option in there for option in re.findall(r"--[a-z]+", said))


@pytest.mark.parametrize(
    "words", [["transfer", "--to", "age=8"], ["evolve", "--along", "age"], ["fit", "--known", "age=3"]]
)
def test_a_model_without_covariates_is_only_fitted(egg_deepsdf, patient, words, tmp_path, capsys):
    command, *rest = words
    assert cli.main([command, str(patient), "--atlas", str(egg_deepsdf), *rest]) == 2
    said = capsys.readouterr().err
    if command == "fit":
        assert "unknown covariate 'age'; its shapes depend on no covariates" in said
    else:
        assert "DeepSDF does not carry shapes to other covariates" in said and "naisr fit" in said
    given = [str(patient), "--atlas", str(egg_deepsdf), "--out", str(tmp_path / "out")]
    assert cli.main(["fit", *given, "--json", str(tmp_path / "fit.json")]) == 0
    assert json.loads((tmp_path / "fit.json").read_text())["lasting"] is None
    assert "volume: " in capsys.readouterr().out and (tmp_path / "out" / "shapes.png").exists()


@pytest.mark.parametrize("ending", ["glb", "vtp"])
def test_what_mesh_writes_fit_reads(told, egg_atlas, tmp_path, ending):
    path = tmp_path / f"shape.{ending}"
    assert (
        cli.main(
            ["mesh", str(egg_atlas), str(path), "--set", "age=6", "--set", "sex=M", "--resolution", "64"]
        )
        == 0
    )
    record = told(path)
    own_cm3 = record["patient"]["volume_cm3"]
    assert own_cm3 == pytest.approx(TRUE_CM3, rel=0.05)
    assert record["volume_cm3"] == pytest.approx(own_cm3, rel=0.05)
    remarks = record["patient"]["remarks"]
    assert [remark["topic"] for remark in remarks] == (["convention"] if ending == "glb" else [])


@pytest.mark.parametrize("ending", ["stl", "ply", "vtk", "vtp", "glb"])
def test_a_file_that_was_cut_off_ends_with_one_sentence(egg_atlas, tmp_path, ending, capfd):
    path = tmp_path / f"cut.{ending}"
    if ending == "vtk":
        pyvista.wrap(egg(6.0, 1.0)).save(path)
    else:
        path.write_bytes(mesh_bytes(egg(6.0, 1.0), ending))
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 3 // 5])
    assert cli.main(["fit", str(path), "--atlas", str(egg_atlas)]) == 2
    out, said = capfd.readouterr()
    assert out == "" and said.startswith(f"naisr: {path.name} is cut off") and said.count("\n") == 1


def test_two_units_that_fit_are_asked_for(egg_atlas, tmp_path, capsys):
    """0.9 and 25.4 times as long as the largest egg, or 10 times, are both plausible."""
    path = saved(egg(6.0, 1.0), tmp_path / "unit.stl", np.diag([0.04, 0.04, 0.04, 1]))
    assert cli.main(["fit", str(path), "--atlas", str(egg_atlas)]) == 2
    said = capsys.readouterr().err
    assert "--scale 10 for centimetres or --scale 25.4 for inches" in said and said.count("\n") == 1
    assert cli.main(["fit", str(path), "--atlas", str(egg_atlas), "--scale", "25.4"]) == 0
