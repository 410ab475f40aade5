"""A broken atlas is explained in the window, which goes on with what it showed."""

from __future__ import annotations

from functools import partial

import pytest
import torch
from eggs import egg, untrained
from safetensors.torch import load_file, save_file

from naisr_model.checkpoint import FORMAT, save
from naisr_viewer.engine.engine import Engine
from naisr_viewer.program.headless import wait_until


@pytest.fixture
def opened(whole_window, tmp_path):
    return whole_window(Engine(folder=tmp_path / "cache"))


def tells(window, words: str) -> bool:
    return words in window.error_text.text()


def test_broken_atlases_are_explained_one_after_the_other(opened, tmp_path):
    window, controller = opened
    save(tmp_path / "good.safetensors", untrained())
    tensors = load_file(tmp_path / "good.safetensors")
    broken = {name: torch.full_like(tensor, float("nan")) for name, tensor in tensors.items()}
    files = {
        "nan.safetensors": "contradicts itself",
        "record.safetensors": "no JSON",
        "empty.safetensors": "is empty",
        "mesh.stl": "is a mesh (STL), not an atlas; open it as a scan: 'Open scan…'",
    }
    save_file(broken, tmp_path / "nan.safetensors", {"format": FORMAT, "version": "1", "record": "{}"})
    save_file(tensors, tmp_path / "record.safetensors", {"format": FORMAT, "version": "1", "record": ""})
    (tmp_path / "empty.safetensors").touch()
    egg(5.0, 1.0).export(tmp_path / "mesh.stl")
    for name, words in files.items():
        controller.open(tmp_path / name)
        wait_until(partial(tells, window, words), 60)
        assert controller.state.atlas is None
