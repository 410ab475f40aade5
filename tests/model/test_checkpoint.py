"""One file holds an atlas, and a bad file gets one sentence."""

import dataclasses
import json
import pickle
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load_file, save_file

from naisr_model.checkpoint import FORMAT, load, save
from naisr_model.errors import InputError


def rewritten(source: Path, target: Path, **changes: str) -> Path:
    """``source`` with other metadata."""
    checkpoint = json.loads(metadata(source)["record"])
    metadata_now = {"format": FORMAT, "version": "1", "record": json.dumps(checkpoint)} | changes
    save_file(load_file(source), target, metadata_now)
    return target


def metadata(path: Path) -> dict[str, str]:
    raw = path.read_bytes()
    return json.loads(raw[8 : 8 + int.from_bytes(raw[:8], "little")])["__metadata__"]


def test_a_checkpoint_comes_back_as_it_was(egg_atlas, tmp_path):
    first = load(egg_atlas)
    save(tmp_path / "again.safetensors", first)
    again = load(tmp_path / "again.safetensors")
    assert again.preset == first.preset and again.frame == first.frame
    assert again.population.covariates == first.population.covariates
    assert (again.latents == first.latents).all() and again.source == first.source
    assert all(torch.equal(again.weights[name], tensor) for name, tensor in first.weights.items())
    assert len(again.latents) == np.sum(~again.population.held_out)


def with_preset(source: Path, target: Path, **changes: str | None) -> Path:
    """``source`` whose preset's record has other entries, or none where the change is None."""
    record = json.loads(metadata(source)["record"])
    preset = {**record["preset"], **changes}
    record["preset"] = {name: value for name, value in preset.items() if value is not None}
    return rewritten(source, target, record=json.dumps(record))


def test_a_file_from_before_there_were_other_models_is_naisr_s(egg_atlas, tmp_path):
    old = load(with_preset(egg_atlas, tmp_path / "old.safetensors", model=None))
    assert old.preset == load(egg_atlas).preset


def test_an_unknown_model_is_named(egg_atlas, tmp_path):
    with pytest.raises(InputError, match=r"model 'cubes', which this program does not know; update"):
        load(with_preset(egg_atlas, tmp_path / "new.safetensors", model="cubes"))
    with pytest.raises(InputError, match="contradicts itself"):
        load(with_preset(egg_atlas, tmp_path / "wrong.safetensors", model="deepsdf"))


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"nowhere.* does not exist; give the path of an atlas"):
        load(tmp_path / "nowhere.safetensors")


@pytest.mark.parametrize("kept", [5, 200, -100])
def test_a_truncated_file_is_refused(egg_atlas, tmp_path, kept):
    path = tmp_path / "short.safetensors"
    path.write_bytes(egg_atlas.read_bytes()[:kept])
    with pytest.raises(InputError, match="not a complete"):
        load(path)


class Bomb:
    target = ""

    def __reduce__(self):
        return (Path.touch, (Path(self.target),))


def test_a_pickle_is_refused_and_not_run(tmp_path):
    bomb = Bomb()
    bomb.target = str(tmp_path / "boom")
    path = tmp_path / "bomb.safetensors"
    path.write_bytes(pickle.dumps(bomb))
    with pytest.raises(InputError):
        load(path)
    assert not (tmp_path / "boom").exists()


def test_foreign_newer_and_inconsistent_files_are_told_apart(egg_atlas, tmp_path):
    path = tmp_path / "x.safetensors"
    with pytest.raises(InputError, match="not an atlas"):
        load(rewritten(egg_atlas, path, format="something"))
    with pytest.raises(InputError, match="newer version"):
        load(rewritten(egg_atlas, path, version="99"))
    with pytest.raises(InputError, match="contradicts itself"):
        load(rewritten(egg_atlas, path, record="{}"))
    checkpoint = load(egg_atlas)
    network = dataclasses.replace(checkpoint.preset.network, latent=9)
    save(
        path, dataclasses.replace(checkpoint, preset=dataclasses.replace(checkpoint.preset, network=network))
    )
    with pytest.raises(InputError, match="contradicts itself"):
        load(path)
