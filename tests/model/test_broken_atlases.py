"""Every broken atlas, made from a good one, is refused in one sentence; nothing of it is run or drawn."""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
import torch
from eggs import label_volume, untrained
from safetensors.torch import load_file, save_file

from naisr_model import cli
from naisr_model.checkpoint import FORMAT, load, save
from naisr_model.errors import InputError

NAN, INF = float("nan"), float("inf")
Tensors = dict[str, torch.Tensor]


@pytest.fixture(params=["naisr", "deepsdf", "asdf", "joint"])
def good(request, tmp_path) -> Path:
    """A small good atlas of each model."""
    path = tmp_path / f"{request.param}.safetensors"
    save(path, untrained(request.param))
    return path


def record_of(path: Path) -> dict[str, Any]:
    raw = path.read_bytes()
    header = json.loads(raw[8 : 8 + int.from_bytes(raw[:8], "little")])
    return json.loads(header["__metadata__"]["record"])


def written(path: Path, tensors: Tensors, record: object, **metadata: str) -> Path:
    """An atlas of these parts; a record that is a text is written as it is."""
    text = record if isinstance(record, str) else json.dumps(record)
    save_file(tensors, path, {"format": FORMAT, "version": "1", "record": text, **metadata})
    return path


def with_entry(record: Mapping[str, Any], where: str, value: object) -> dict[str, Any]:
    """``record`` with another value at ``population.covariates.0.scale``."""
    changed = json.loads(json.dumps(record))
    *outer, last = [int(step) if step.isdigit() else step for step in where.split(".")]
    place = changed
    for step in outer:
        place = place[step]
    place[last] = value
    return changed


def test_the_good_ones_are_read(good):
    assert written(good, load_file(good), record_of(good)) == good
    assert load(good).name == "eggs"


RECORDS = [
    ("name", None, "'name' is None, not a text"),
    ("frame.scale_mm", 0, "a frame of 0 mm a unit"),
    ("frame.scale_mm", NAN, "'scale_mm' is nan, not a finite number"),
    ("frame.scale_mm", 1e300, "not a finite number"),
    ("frame.centre_mm", [0, 0, INF], "'centre_mm' holds what is no finite number"),
    ("frame.centre_mm", [0.0, 0.0], "3D shapes in a 2D frame"),
    ("frame.centre_mm", [], "0 coordinates"),
    ("population.held_out", [True] * 6, "no shape is left to train on"),
    ("population.held_out", [False] * 3, "differ in length"),
    ("population.held_out", ["no"] * 6, "not true or false"),
    ("population.subjects", ["a", "b"], "6 by 2 numbers where 2 by 2"),
    ("population.subjects", ["a"] * 6, "subject 'a', visit '1' is there twice"),
    ("population.visits", ["1"], "differ in length"),
    ("population.values", [[1.0, 1.0]], "1 by 2 numbers where 6 by 2"),
    ("population.values", [[1.0] * 6] * 2, "2 by 6 numbers where 6 by 2"),
    ("population.values", [[NAN, 1.0]] * 6, "no finite number"),
    ("population.values", [[5.0, 0.5]] * 6, "'sex' has values beside its two levels"),
    ("population.covariates", "age", "not a list"),
    ("population.covariates.0.scale", 0, "'age' has the scale 0"),
    ("population.covariates.0.scale", -1, "'age' has the scale -1"),
    ("population.covariates.0.scale", True, "not a finite number"),
    ("population.covariates.0.centre", 10**400, "'centre' is 1000"),
    ("population.covariates.0.range", [9, 1], "'age' ranges from 9 to 1"),
    ("population.covariates.0.range", [1], "1 numbers where 2"),
    ("population.covariates.0.kind", ["continuous"], "not a text"),
    ("population.covariates.0.kind", "circular", "unknown kind 'circular'"),
    ("population.covariates.1.levels", ["F", "F"], "twice the level 'F'"),
    ("population.covariates.1.scale", 2, "not -1 and 1"),
    ("population.covariates.1.name", "age", "two covariates have the same name"),
    ("alignment.method", "magic", "alignment is by 'magic'"),
    ("alignment", {"method": "icp", "origin": "", "reference": {}}, "0 points of reference"),
    ("alignment.reference", {"tip": [0, 0, NAN]}, "'tip' holds what is no finite number"),
    ("source", {"population": {"a": 1}}, "not a finite number"),
    ("training", {"iterations": "many"}, "'iterations' is 'many', not a number"),
    ("preset.network.latent", 0, "'network.latent' is 0; give 1 to 4096"),
    ("preset.network.latent", 10**9, "give 1 to 4096"),
    ("preset.network.latent", 9, "is .*4.* where .* by (9|10) is expected|by [56] where .* by 1[01]"),
    ("preset.network.dim", 4, "give 2 to 3"),
    ("preset.network.dim", "three", "expected int"),
    ("preset.training.template_rate", NAN, "'training.template_rate' is nan; give 1e-09 to 1000"),
    ("preset.training.epochs", -1, "give 1 to 1000000"),
    ("preset.training.seed", -1, "give 0 to 4294967295"),
    ("preset.training.loss", {"latent_sigma": 0}, "'training.loss.latent_sigma' is 0.0"),
    ("preset", [], "'preset' is \\[\\], not a record"),
]


@pytest.mark.parametrize(("where", "value", "reason"), RECORDS)
def test_a_record_with_another_entry_is_refused(good, where, value, reason):
    path = written(good, load_file(good), with_entry(record_of(good), where, value))
    with pytest.raises(InputError, match=f"contradicts itself .*({reason}).*; copy it again"):
        load(path)


@pytest.mark.parametrize("key", ["name", "preset", "population", "frame", "alignment", "source", "training"])
def test_a_record_without_an_entry_is_refused(good, key):
    record = record_of(good)
    del record[key]
    with pytest.raises(InputError, match=f"'{key}' is missing"):
        load(written(good, load_file(good), record))


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "no JSON"),
        ("[]", "not a record"),
        ("NaN", "not a record"),
        ("[" * 100_000, "nested too deeply"),
        ('{"name": ' + "9" * 5000 + "}", "no JSON"),
    ],
)
def test_a_record_that_is_none_is_refused(good, text, reason):
    with pytest.raises(InputError, match=reason):
        load(written(good, load_file(good), text))


@pytest.mark.parametrize("version", ["abc", "", "0", "-1", "1.5", "²"])
def test_a_version_that_is_none_is_refused(good, version):
    with pytest.raises(InputError, match="unknown version"):
        load(written(good, load_file(good), record_of(good), version=version))


def filled(value: float) -> Callable[[torch.Tensor], torch.Tensor]:
    return lambda tensor: torch.full_like(tensor, value)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (filled(NAN), "no finite number"),
        (filled(-INF), "no finite number"),
        (filled(3e38), "its networks give no distances"),
        (lambda tensor: tensor[..., :1].clone(), "is expected"),
        (lambda tensor: tensor.double(), "is of the type F64 where F32"),
        (lambda tensor: tensor.bfloat16(), "is of the type BF16 where F32"),
    ],
)
def test_weights_that_are_none_are_refused(good, change, reason):
    tensors = load_file(good)
    name = next(name for name in tensors if name.endswith("last_weight") and "displacement" not in name)
    with pytest.raises(InputError, match=reason):
        load(written(good, {**tensors, name: change(tensors[name])}, record_of(good)))


def test_codes_that_are_none_are_refused(good):
    tensors = load_file(good)
    for codes, reason in ((filled(NAN)(tensors["latents"]), "no finite"), (tensors["latents"][:2], "2 by 4")):
        with pytest.raises(InputError, match=reason):
            load(written(good, {**tensors, "latents": codes.clone()}, record_of(good)))


def test_tensors_too_few_and_too_many_are_refused(good):
    tensors = load_file(good)
    name = next(name for name in tensors if name.startswith("network."))
    with pytest.raises(InputError, match=f"'{name}' is missing"):
        load(written(good, {key: tensor for key, tensor in tensors.items() if key != name}, record_of(good)))
    with pytest.raises(InputError, match=r"'network.more' belongs to no network"):
        load(written(good, {**tensors, "network.more": torch.zeros(2)}, record_of(good)))


def test_huge_networks_are_refused_before_they_are_made(good):
    record = record_of(good)
    kind = "template" if "template" in record["preset"]["network"] else "shape"
    huge = with_entry(record, f"preset.network.{kind}", {"width": 4096, "hidden": 60, "omega0": 5.0})
    with pytest.raises(InputError, match="weights, more than 2e\\+08"):
        load(written(good, load_file(good), huge))


def test_a_bit_that_was_lost_on_the_way_is_found(good):
    raw = bytearray(good.read_bytes())
    raw[-9] ^= 1
    good.write_bytes(raw)
    with pytest.raises(InputError, match="was damaged after it was written; copy it again"):
        load(good)


def test_an_atlas_that_is_written_over_stays_as_it_was_read(good):
    checkpoint = load(good)
    before = {name: tensor.clone() for name, tensor in checkpoint.weights.items()}
    good.write_bytes(b"\xff" * good.stat().st_size)
    assert all(torch.equal(checkpoint.weights[name], tensor) for name, tensor in before.items())


@pytest.mark.parametrize("announced", [0, 100, 90_000_000, 2**62])
def test_a_header_that_is_none_is_refused(tmp_path, announced):
    path = tmp_path / "x.safetensors"
    path.write_bytes(struct.pack("<Q", announced) + b"[" * 100)
    with pytest.raises(InputError, match="not a complete"):
        load(path)


def test_what_else_stands_there_is_told(tmp_path):
    with pytest.raises(InputError, match="is a folder; give the path of an atlas"):
        load(tmp_path)
    os.mkfifo(tmp_path / "pipe.safetensors")
    with pytest.raises(InputError, match="is a pipe"):
        load(tmp_path / "pipe.safetensors")


MESHES = {
    "a.stl": r"a mesh \(STL\)",
    "b.ply": r"a mesh \(PLY\)",
    "c.obj": r"a mesh \(OBJ\)",
    "d.glb": r"a mesh \(GLB\)",
}


def test_files_of_patients_are_told_by_their_contents(tmp_path, ball, capsys):
    for name, title in MESHES.items():
        ball.export(tmp_path / name)
        (tmp_path / name).rename(tmp_path / "p01.safetensors")
        with pytest.raises(InputError, match=f"is {title}, not an atlas; open it as a scan: 'Open scan…'"):
            load(tmp_path / "p01.safetensors")
    label_volume(tmp_path / "v.nrrd")
    assert cli.main(["info", str(tmp_path / "v.nrrd")]) == 2
    told = capsys.readouterr().err
    assert "is an NRRD volume" in told and "'naisr fit'" in told and told.count("\n") == 1
    torch.save({"a": 1}, tmp_path / "state.pt")
    with pytest.raises(InputError, match=r"PyTorch file, not an atlas; give a .safetensors file"):
        load(tmp_path / "state.pt")


def broken(good: Path) -> Path:
    tensors = load_file(good)
    name = next(name for name in tensors if name.endswith("hidden_weight"))
    return written(good, {**tensors, name: filled(NAN)(tensors[name])}, record_of(good))


@pytest.mark.parametrize(
    "words",
    [
        ["info", "ATLAS"],
        ["mesh", "ATLAS", "OUT.stl"],
        ["fit", "PATIENT", "--atlas", "ATLAS"],
        ["transfer", "PATIENT", "--atlas", "ATLAS", "--to", "age=3"],
        ["evolve", "PATIENT", "--atlas", "ATLAS"],
        ["evaluate", "reconstruction", "ATLAS"],
        ["evaluate", "calibration", "ATLAS"],
        ["bench", "ATLAS", "--quick"],
    ],
)
def test_every_command_refuses_it_in_one_sentence(good, tmp_path, ball, capsys, words):
    patient, out = tmp_path / "p.stl", tmp_path / "out.stl"
    ball.export(patient)
    places = {"ATLAS": broken(good), "OUT.stl": out, "PATIENT": patient}
    assert cli.main([str(places.get(word, word)) for word in words]) == 2
    told = capsys.readouterr().err
    assert "holds what is no finite number" in told and told.count("\n") == 1
    assert not out.exists()


def test_a_source_that_cannot_be_made_again_asks_for_the_store(tmp_path, capsys):
    path = tmp_path / "a.safetensors"
    save(path, untrained())
    for source in (
        {"population": "airway", "seed": 0, "patients": 10**12},
        {"population": "airway", "seed": "x", "patients": 3},
        {"population": "airway", "seed": 0, "patients": 3},
    ):
        written(path, load_file(path), with_entry(record_of(path), "source", source))
        assert cli.main(["evaluate", "reconstruction", str(path)]) == 2
        assert "give the store it was trained on with --store" in capsys.readouterr().err


def test_figures_that_could_not_be_measured_are_left_out(tmp_path, capsys):
    path = tmp_path / "a.safetensors"
    save(path, untrained())
    written(path, load_file(path), with_entry(record_of(path), "training", {"iterations": 3, "seconds": NAN}))
    assert cli.main(["info", str(path)]) == 0
    said = capsys.readouterr().out
    assert "training: 3 iterations\n" in said and "nan" not in said


def test_a_surface_far_outside_of_all_numbers_is_none(tmp_path, capsys):
    path, out = tmp_path / "a.safetensors", tmp_path / "x.stl"
    save(path, untrained())
    words = ["mesh", str(path), str(out), "--set", "age=1e300", "--extrapolate", "--resolution", "16"]
    assert cli.main(words) == 2
    assert "'age' is '1e300'; expected a number in years" in capsys.readouterr().err and not out.exists()
