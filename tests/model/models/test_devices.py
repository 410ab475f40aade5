"""Evaluation on another device, played by torch's meta device: it knows shapes and computes nothing."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from eggs import egg
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves

from naisr_model import atlas as facade
from naisr_model.atlas import Atlas
from naisr_model.cli import main
from naisr_model.errors import InputError
from naisr_model.models.devices import usable_device

MOVES = (torch.ops.aten.to, torch.ops.aten._to_copy, torch.ops.aten.copy_)


class OneDevice(TorchDispatchMode):
    """Fails where an operation mixes devices, or is in double precision elsewhere than on the CPU."""

    def __init__(self) -> None:
        super().__init__()
        self.away = 0

    def __torch_dispatch__(self, func, types, args=(), kwargs=None):
        result = func(*args, **(kwargs or {}))
        tensors = [leaf for leaf in tree_leaves((args, kwargs, result)) if isinstance(leaf, Tensor)]
        kinds = {tensor.device.type for tensor in tensors}
        assert len(kinds) == 1 or func.overloadpacket in MOVES, f"{func.name()} mixes {kinds}"
        away = [tensor for tensor in tree_leaves(result) if isinstance(tensor, Tensor) and tensor.is_meta]
        assert all(tensor.dtype != torch.float64 for tensor in away), f"{func.name()} is in double precision"
        self.away += len(away)
        return result


@pytest.fixture
def away(egg_atlas, monkeypatch) -> Atlas:
    """An atlas on the meta device, whose results come back as ones."""
    home, nonzero = Tensor.numpy, Tensor.nonzero

    def numpy(tensor, *, force=False):
        if not tensor.is_meta:
            return home(tensor, force=force)
        assert force, "a tensor elsewhere has no numpy array"
        return np.ones(tensor.shape, np.float32)

    monkeypatch.setattr(Tensor, "numpy", numpy)
    monkeypatch.setattr(Tensor, "cpu", lambda tensor: torch.ones(tensor.shape) if tensor.is_meta else tensor)
    monkeypatch.setattr(
        Tensor,
        "nonzero",
        lambda tensor: tensor.new_zeros(len(tensor), 1, dtype=int) if tensor.is_meta else nonzero(tensor),
    )
    monkeypatch.setattr(facade, "usable_device", torch.device)
    return Atlas.load(egg_atlas, "meta")


def test_surfaces_and_distances_are_evaluated_where_the_networks_are(away):
    code = np.ones(4)
    with OneDevice() as watched:
        away.template(16)
        away.shape({"age": 3.0}, code, 16)
        away.effect("sex", 1.0, code, 16)
        away.sdf([[0.0, 0.0, 1.0]], {"age": 3.0, "sex": 1.0}, code)
    assert watched.away > 0


def test_displacements_are_tabulated_where_the_networks_are_and_tracked_at_home(away):
    template = egg(5.0, 0.0)
    with OneDevice() as watched:
        tracker = away.tracker(template, away.tabulate(template, np.ones(4)))
    assert watched.away > 0
    assert {tracker.template_points.device.type, tracker.displacements.lower.device.type} == {"cpu"}


def test_a_fit_works_at_home_and_finds_the_same(away, egg_atlas):
    patient = egg(6.0, 1.0)
    with OneDevice() as watched:
        there = away.fit(patient, {"age": 6.0})
    here = Atlas.load(egg_atlas).fit(patient, {"age": 6.0})
    np.testing.assert_array_equal(there.latent, here.latent)
    assert there.covariates == here.covariates
    assert there.residual_mm == here.residual_mm
    assert watched.away == 0


@pytest.mark.parametrize(
    "name", ["meta", "typewriter", "cuda:99", *([] if torch.cuda.is_available() else ["cuda"])]
)
def test_a_device_that_cannot_compute_is_refused_in_words(name):
    with pytest.raises(InputError, match=f"'{name}' here; choose cpu"):
        usable_device(name)


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU")
def test_the_command_says_it_in_one_sentence(egg_atlas, tmp_path, capsys):
    assert main(["mesh", str(egg_atlas), str(tmp_path / "egg.stl"), "--device", "cuda"]) == 2
    error = capsys.readouterr().err
    assert error == "naisr: torch cannot compute on 'cuda' here; choose cpu\n"
    assert not (tmp_path / "egg.stl").exists()


def test_the_cpu_can_compute():
    assert usable_device("cpu") == torch.device("cpu")
