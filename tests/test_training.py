"""Training on shapes whose covariate effects are known."""

import dataclasses
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import torch
from eggs import egg, egg_preset

from naisr_model.atlas import Atlas
from naisr_model.checkpoint import load
from naisr_model.config import FitConfig
from naisr_model.errors import Cancelled, InputError
from naisr_model.learning import train as training
from naisr_model.learning.fit import fit_latents
from naisr_model.learning.objective import Batch
from naisr_model.learning.train import train


def test_the_effects_are_those_of_the_population(egg_atlas):
    atlas = Atlas.load(egg_atlas)
    for age in (2.0, 5.0, 8.0):
        for sex in (-1.0, 1.0):
            shape, truth = atlas.shape({"age": age, "sex": sex}, resolution=64), egg(age, sex)
            assert shape.is_watertight
            assert shape.volume == pytest.approx(truth.volume, rel=0.1)
            assert shape.extents == pytest.approx(truth.extents, rel=0.1)
    older = atlas.effect("age", 8.0, resolution=64).extents / atlas.effect("age", 2.0, resolution=64).extents
    assert older[2] > 1.2
    assert older[:2] == pytest.approx(1, abs=0.08)
    assert atlas.template(64).volume == pytest.approx(
        egg(atlas.population.centre["age"], 0.0).volume, rel=0.1
    )


def test_the_checkpoint_tells_how_it_was_trained(egg_atlas):
    record = load(egg_atlas).training
    assert record["iterations"] == record["planned_iterations"] == 600
    assert record["folded_share"] < 0.01
    templates = sorted((egg_atlas.parent / (egg_atlas.name + ".training") / "templates").iterdir())
    assert [path.name for path in templates][-1] == "epoch_00100.ply"


def same(first, second):
    return all(torch.equal(first.weights[name], tensor) for name, tensor in second.weights.items()) and (
        np.array_equal(first.latents, second.latents)
    )


KILLED = """
import os, signal, sys, torch
from pathlib import Path
from eggs import egg_preset
from naisr_model.data.store import SampleStore
from naisr_model.learning import train as training

torch.set_num_threads(1)
training.SAVE_SECONDS = 0.0
def report(told):
    if told.iteration == 7:
        os.kill(os.getpid(), signal.SIGKILL)
training.train(SampleStore.open(sys.argv[1]), egg_preset(epochs=6), Path(sys.argv[2]), report=report)
"""


def test_a_killed_training_ends_like_one_that_was_not(egg_store, tmp_path):
    preset = egg_preset(epochs=6)
    whole = train(egg_store, preset, tmp_path / "whole.safetensors")
    out = tmp_path / "killed.safetensors"
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parent)}
    command = [sys.executable, "-c", KILLED, str(egg_store.path), str(out)]
    assert subprocess.run(command, env=environment, check=False).returncode == -signal.SIGKILL
    assert load(out).training["iterations"] in (6, 7)
    assert same(train(egg_store, preset, out), whole)


def test_a_stopped_training_keeps_what_it_reached(egg_store, tmp_path):
    out, preset = tmp_path / "stopped.safetensors", egg_preset(epochs=6)
    seen: list[training.Report] = []
    with pytest.raises(Cancelled):
        train(egg_store, preset, out, report=seen.append, should_stop=lambda: len(seen) == 5)
    assert load(out).training["iterations"] == 5
    assert train(egg_store, preset, out, report=seen.append).training["iterations"] == 12
    assert [told.iteration for told in seen] == list(range(1, 13))


def test_other_settings_do_not_continue_a_training(egg_store, tmp_path):
    out = tmp_path / "a.safetensors"
    train(egg_store, egg_preset(epochs=1), out)
    with pytest.raises(InputError, match="other settings"):
        train(egg_store, egg_preset(epochs=2), out)


def test_divergence_stops_with_advice_and_keeps_the_last_good_state(egg_store, tmp_path, monkeypatch):
    monkeypatch.setattr(training, "SAVE_SECONDS", 0.0)
    preset = egg_preset(epochs=50)
    wild = dataclasses.replace(preset, training=dataclasses.replace(preset.training, template_rate=30.0))
    out = tmp_path / "wild.safetensors"
    with pytest.raises(InputError, match=r"broke down.*last good state is in .*template_rate below 30"):
        train(egg_store, wild, out)
    assert all(torch.isfinite(tensor).all() for tensor in load(out).weights.values())


def test_a_time_budget_bounds_the_training(egg_store, tmp_path):
    started = time.monotonic()
    checkpoint = train(egg_store, egg_preset(epochs=100_000), tmp_path / "b.safetensors", time_budget_s=2.0)
    assert 20 <= checkpoint.training["iterations"] < 100_000
    assert time.monotonic() - started < 30


def test_fitting_recovers_the_code_of_a_shape_the_atlas_can_make(egg_atlas):
    checkpoint = load(egg_atlas)
    network = checkpoint.network()
    latent = torch.as_tensor(checkpoint.latents[:1])
    covariates = torch.tensor([[1.0, 1.0]])
    generator = np.random.default_rng(0)
    points = torch.as_tensor(generator.uniform(-1, 1, (1, 400, 3)), dtype=torch.float32)
    with torch.inference_mode():
        target = network(points, covariates, latent)[0]
    batch = Batch(points[:, :1], torch.ones(1, 1, 3), points.clone(), target.clone())
    weights = dataclasses.replace(
        checkpoint.preset.training.loss,
        surface_eikonal=0.0,
        surface_distance=0.0,
        surface_normal=0.0,
        space_eikonal=0.0,
        latent=1e-4,
    )
    config = FitConfig(steps=300, rate=2e-2)
    found = fit_latents(network, lambda rng: batch, covariates, config, weights)
    with torch.inference_mode():
        missed = (network(points, covariates, found)[0] - target).abs().mean()
        without = (network(points, covariates, torch.zeros_like(found))[0] - target).abs().mean()
    assert missed < 0.2 * without + 1e-5
    with pytest.raises(Cancelled):
        fit_latents(network, lambda rng: batch, covariates, config, weights, should_stop=lambda: True)
