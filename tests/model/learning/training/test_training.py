"""Training on shapes whose covariate effects are known."""

import dataclasses
import itertools
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from eggs import egg, egg_preset, egg_warping_preset

from naisr_model.atlas import Atlas
from naisr_model.checkpoint import load
from naisr_model.config import FitConfig, LossWeights, SirenConfig
from naisr_model.data.store import SampleStore
from naisr_model.errors import Cancelled, InputError
from naisr_model.learning.fitting.paper import fit_latents
from naisr_model.learning.training import loop as training
from naisr_model.learning.training import step
from naisr_model.learning.training.loop import train
from naisr_model.learning.training.objective import Batch
from naisr_model.learning.training.report import Report
from naisr_model.models.factory import preset as named
from naisr_model.progress import Progress


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
    assert record["iterations"] == 600
    assert record["folded_share"] < 0.01
    templates = sorted((egg_atlas.parent / (egg_atlas.name + ".training") / "templates").iterdir())
    assert [path.name for path in templates][-1] == "epoch_00050.ply"


def same(first, second):
    return all(torch.equal(first.weights[name], tensor) for name, tensor in second.weights.items()) and (
        np.array_equal(first.latents, second.latents)
    )


KILLED = """
import os, signal, sys, torch
from pathlib import Path
from eggs import egg_preset
from naisr_model.data.store import SampleStore
from naisr_model.learning.training import loop as training
from naisr_model.learning.training import step

torch.set_num_threads(1)
training.SAVE_SECONDS = 0.0
def report(told):
    if told.iteration == 7:
        os.kill(os.getpid(), signal.SIGKILL)
preset = egg_preset(epochs=6, hidden_rate=0.02)
training.train(SampleStore.open(sys.argv[1]), preset, Path(sys.argv[2]), report=report)
"""


def test_a_killed_training_ends_like_one_that_was_not(egg_store, tmp_path):
    preset = egg_preset(epochs=6, hidden_rate=0.02)
    whole = train(egg_store, preset, tmp_path / "whole.safetensors")
    out = tmp_path / "killed.safetensors"
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[3])}
    command = [sys.executable, "-c", KILLED, str(egg_store.path), str(out)]
    assert subprocess.run(command, env=environment, check=False).returncode == -signal.SIGKILL
    assert load(out).training["iterations"] in (6, 7)
    assert same(train(egg_store, preset, out), whole)


@pytest.mark.parametrize("rate", [0.0, 0.02])
def test_the_hidden_layers_learn_by_either_rule(egg_store, tmp_path, rate):
    preset = egg_preset(epochs=6, hidden_rate=rate)
    seen: list[Report] = []
    train(egg_store, preset, tmp_path / "a.safetensors", report=seen.append)
    assert seen[-1].losses["total"] < 0.6 * seen[0].losses["total"]
    with pytest.raises(InputError, match="a training with other settings"):
        train(egg_store, egg_preset(epochs=6, hidden_rate=0.1), tmp_path / "a.safetensors")


@pytest.mark.parametrize("model", ["dit", "ndf", "invertible"])
def test_models_that_move_points_in_their_own_way_learn(egg_store, tmp_path, model):
    given = egg_warping_preset(model, epochs=2)
    few = {"batch_shapes": 7, "surface_points": 16, "near_points": 8, "uniform_points": 8}
    training = dataclasses.replace(given.training, **few, population_share=0.0)
    seen: list[dict[str, float]] = []
    preset, out = dataclasses.replace(given, training=training), tmp_path / "a.safetensors"
    train(egg_store, preset, out, report=lambda told: seen.append(told.losses))
    assert seen[-1]["total"] < 0.8 * seen[0]["total"]
    own = {"dit": {"underway", "pointwise", "pointpair"}, "ndf": {"pointwise", "pointpair"}}
    assert own.get(model, {"ridge", "centring"}) <= set(seen[0])
    assert load(out).training["folded_share"] == 0


@pytest.mark.parametrize(
    ("model", "term"),
    [("naisr", "underway"), ("deepsdf", "pointwise"), ("asdf", "pointpair"), ("dit", "ridge")],
)
def test_a_term_that_a_model_has_no_use_for_is_refused(egg_store, tmp_path, model, term):
    plain = named("demo" if model == "naisr" else f"{model}-demo")
    loss = dataclasses.replace(plain.training.loss, **{term: 1.0})
    preset = dataclasses.replace(plain, training=dataclasses.replace(plain.training, loss=loss))
    with pytest.raises(InputError, match=f"'training.loss.{term}' is 1.0, but .* has no use for it; leave"):
        train(egg_store, preset, tmp_path / "a.safetensors")


def test_a_stopped_training_keeps_what_it_reached(egg_store, tmp_path):
    out, preset = tmp_path / "stopped.safetensors", egg_preset(epochs=6)
    seen: list[training.Report] = []
    with pytest.raises(Cancelled):
        train(
            egg_store, preset, out, report=seen.append, progress=Progress(is_unwanted=lambda: len(seen) == 5)
        )
    assert load(out).training["iterations"] == 5
    assert train(egg_store, preset, out, report=seen.append).training["iterations"] == 12
    assert [told.iteration for told in seen] == list(range(1, 13))


def test_other_settings_do_not_continue_a_training(egg_store, tmp_path):
    out = tmp_path / "a.safetensors"
    train(egg_store, egg_preset(epochs=1), out)
    with pytest.raises(InputError, match="other settings"):
        train(egg_store, egg_preset(epochs=2), out)


def test_other_data_do_not_continue_a_training(egg_store, tmp_path):
    out, preset = tmp_path / "a.safetensors", egg_preset(epochs=1)
    train(egg_store, preset, out)
    population = dataclasses.replace(egg_store.population, values=egg_store.population.values[::-1].copy())
    with pytest.raises(InputError, match="other settings or data"):
        train(dataclasses.replace(egg_store, population=population), preset, out)


def test_what_no_training_made_is_left_alone(egg_store, egg_table, egg_atlas, tmp_path):
    table, atlas = tmp_path / "table.csv", tmp_path / "given.safetensors"
    shutil.copy(egg_table, table)
    shutil.copy(egg_atlas, atlas)
    for out in (table, atlas):
        before = out.read_bytes()
        with pytest.raises(InputError, match=r"is there already, and no training .* give another --out"):
            train(egg_store, egg_preset(epochs=1), out)
        assert out.read_bytes() == before
    assert sorted(os.listdir(tmp_path)) == ["given.safetensors", "table.csv"]
    with pytest.raises(InputError, match=r"is a folder; give the name of the \.safetensors file"):
        train(egg_store, egg_preset(epochs=1), tmp_path)


def test_a_second_training_of_the_same_atlas_is_told(egg_store, tmp_path):
    out, told = tmp_path / "a.safetensors", []

    def second(_report: training.Report) -> None:
        with pytest.raises(InputError, match=r"another training writes .* wait until it has ended") as error:
            train(egg_store, egg_preset(epochs=1), out)
        told.append(error)

    train(egg_store, egg_preset(epochs=1), out, report=second)
    assert told and not (out.with_name("a.safetensors.training") / ".lock").exists()


def test_a_training_that_finds_no_room_keeps_what_it_saved_and_goes_on_later(egg_store, tmp_path, no_room):

    out, preset = tmp_path / "a.safetensors", egg_preset(epochs=4)
    whole = train(egg_store, preset, tmp_path / "whole.safetensors")
    seen: list[training.Report] = []
    with pytest.raises(Cancelled):
        stop = Progress(is_unwanted=lambda: len(seen) == 3)
        train(egg_store, preset, out, report=seen.append, progress=stop)
    with no_room(4_000), pytest.raises(InputError, match=r"cannot write .*state\.pt: File too large; "):
        train(egg_store, preset, out)
    assert load(out).training["iterations"] == 3
    left = [path.name for path in tmp_path.rglob(".*")]
    assert left == []
    assert same(train(egg_store, preset, out), whole)


def test_settings_that_do_not_fit_are_refused(egg_store, tmp_path):
    flat = dataclasses.replace(egg_preset(1), network=named("paper-starman").network)
    with pytest.raises(InputError, match="2D shapes and the store holds 3D"):
        train(egg_store, flat, tmp_path / "a.safetensors")
    with pytest.raises(InputError, match="cannot compute on 'abacus'"):
        train(egg_store, egg_preset(1), tmp_path / "a.safetensors", device="abacus")


def diverging(preset):
    return dataclasses.replace(preset, training=dataclasses.replace(preset.training, template_rate=30.0))


def test_divergence_stops_with_advice_and_keeps_the_last_good_state(egg_store, tmp_path, monkeypatch):
    monkeypatch.setattr(training, "SAVE_SECONDS", 0.0)
    losses: list[float] = []
    out = tmp_path / "wild.safetensors"
    with pytest.raises(InputError, match=r"broke down.*last good state is in .*template_rate below 30"):
        train(
            egg_store,
            diverging(egg_preset(epochs=50)),
            out,
            report=lambda r: losses.append(r.losses["total"]),
        )
    kept = load(out)
    assert kept.training["iterations"] == 0  # the first step already leaves every good state
    assert all((tensor.abs() < 10).all() for tensor in kept.weights.values())


def test_nan_stops_a_training_at_once(egg_store, tmp_path, monkeypatch):
    nothing = lambda *_, **__: {"broken": torch.tensor(float("nan"), requires_grad=True)}  # noqa: E731
    monkeypatch.setattr(step, "latent_term", nothing)
    with pytest.raises(InputError, match=r"iteration 0 \(loss nan\); no good state"):
        train(egg_store, egg_preset(epochs=1), tmp_path / "nan.safetensors")


@pytest.mark.parametrize("rate", ["template_rate", "displacement_rate", "latent_rate"])
def test_the_last_step_is_judged_too(egg_store, tmp_path, monkeypatch, rate):
    def broken(optimiser):
        for group in optimiser.param_groups:
            if group["setting"] == rate:
                for parameter in group["params"]:
                    parameter.data.fill_(float("nan"))

    monkeypatch.setattr(torch.optim.Adam, "step", broken)
    plain = egg_preset(epochs=1)
    preset = dataclasses.replace(
        plain, training=dataclasses.replace(plain.training, batch_shapes=100, population_share=0.0)
    )
    with pytest.raises(InputError, match=r"broke down at iteration 1 .* a latent_rate below"):
        train(egg_store, preset, tmp_path / "a.safetensors")
    assert not (tmp_path / "a.safetensors").exists()


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("template_rate", float("nan")),
        ("latent_rate", float("inf")),
        ("epochs", 0),
        ("epochs", -1),
        ("seed", -1),
        ("batch_shapes", 0),
        ("surface_points", -5),
        ("population_share", 2.0),
    ],
)
def test_a_setting_out_of_range_is_named_before_anything_is_written(egg_store, tmp_path, setting, value):
    plain = egg_preset(epochs=1)
    preset = dataclasses.replace(plain, training=dataclasses.replace(plain.training, **{setting: value}))
    with pytest.raises(InputError, match=f"the setting 'training.{setting}' is {value}; give .* to"):
        train(egg_store, preset, tmp_path / "a.safetensors")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_is_no_atlas_to_write(egg_store, tmp_path):
    for folder in (tmp_path, Path()):
        with pytest.raises(InputError, match="is a folder; give the name of the"):
            train(egg_store, egg_preset(epochs=1), folder)


def test_networks_too_large_for_any_machine_are_refused_before_they_are_made(egg_store, tmp_path):
    plain = egg_preset(epochs=1)
    network = dataclasses.replace(plain.network, template=SirenConfig(4096, 64))
    with pytest.raises(InputError, match=r"networks have 1\.1e\+09 weights, more than 2e\+08; give smaller"):
        train(egg_store, dataclasses.replace(plain, network=network), tmp_path / "a.safetensors")


@pytest.fixture(scope="module")
def stopped(egg_store, tmp_path_factory) -> Path:
    """An atlas in training, and the state beside it."""
    out = tmp_path_factory.mktemp("stopped") / "a.safetensors"
    seen: list[training.Report] = []
    with pytest.raises(Cancelled):
        train(
            egg_store,
            egg_preset(epochs=2),
            out,
            report=seen.append,
            progress=Progress(is_unwanted=lambda: len(seen) == 2),
        )
    return out


def with_nan(tensor):
    return torch.full_like(tensor, float("nan"))


@pytest.mark.parametrize(
    "change",
    [
        lambda state: state | {"iteration": "many"},
        lambda state: state | {"iteration": -1},
        lambda state: state | {"iteration": 10**9},
        lambda state: state | {"seconds": float("inf")},
        lambda state: state | {"best": float("nan")},
        lambda state: state | {"codes": state["codes"][:1].clone()},
        lambda state: state | {"codes": with_nan(state["codes"])},
        lambda state: state | {"network": {name: with_nan(one) for name, one in state["network"].items()}},
        lambda state: state | {"network": {}},
        lambda state: state | {"optimisers": [{"state": {0: {"exp_avg": torch.zeros(2)}}}]},
        lambda state: state | {"optimisers": [{"state": {99: state["optimisers"][0]["state"][0]}}]},
        lambda state: state | {"optimisers": state["optimisers"] * 2},
        lambda state: {name: value for name, value in state.items() if name != "fingerprint"},
        lambda state: [1, 2],
    ],
)
def test_a_state_of_other_contents_is_refused(stopped, egg_store, tmp_path, change):
    out = tmp_path / "a.safetensors"
    place = tmp_path / "a.safetensors.training" / "state.pt"
    place.parent.mkdir()
    state = torch.load(stopped.with_name(stopped.name + ".training") / "state.pt", weights_only=True)
    torch.save(change(state), place)
    with pytest.raises(
        InputError,
        match=r"state .*state\.pt cannot be read \(.*; delete its folder and a\.safetensors to start",
    ):
        train(egg_store, egg_preset(epochs=2), out)
    assert not out.exists()


def test_a_state_with_a_bit_lost_is_refused_and_a_pickle_is_not_run(stopped, egg_store, tmp_path):
    out = tmp_path / "a.safetensors"
    place = tmp_path / "a.safetensors.training" / "state.pt"
    place.parent.mkdir()
    raw = bytearray((stopped.with_name(stopped.name + ".training") / "state.pt").read_bytes())
    raw[len(raw) // 2] ^= 1
    place.write_bytes(raw)
    with pytest.raises(InputError, match="was damaged after it was written"):
        train(egg_store, egg_preset(epochs=2), out)
    torch.save({"fingerprint": Touch(tmp_path / "boom")}, place)
    with pytest.raises(InputError, match="cannot be read"):
        train(egg_store, egg_preset(epochs=2), out)
    assert not (tmp_path / "boom").exists()


class Touch:
    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self):
        return (Path.touch, (self.path,))


def test_a_time_budget_bounds_the_training_over_all_its_runs(egg_store, tmp_path, monkeypatch):
    clock = itertools.count(step=0.01)
    monkeypatch.setattr(training.time, "monotonic", lambda: next(clock))
    out, preset = tmp_path / "b.safetensors", egg_preset(epochs=100_000)
    seen: list[training.Report] = []
    with pytest.raises(Cancelled):
        train(
            egg_store,
            preset,
            out,
            time_budget_s=1.0,
            report=seen.append,
            progress=Progress(is_unwanted=lambda: len(seen) > 9),
        )
    checkpoint = train(egg_store, preset, out, time_budget_s=1.0, report=seen.append)
    assert checkpoint.training["seconds"] == pytest.approx(1.0, abs=0.05)
    assert seen[-1].share >= 1 and 20 < len(seen) < 110
    assert [told.iteration for told in seen] == list(range(1, len(seen) + 1))


def test_fitting_recovers_the_code_of_a_shape_the_atlas_can_make(egg_atlas):
    checkpoint = load(egg_atlas)
    network = checkpoint.model()
    latent = torch.as_tensor(checkpoint.latents[:1])
    covariates = torch.tensor([[1.0, 1.0]])
    generator = np.random.default_rng(0)
    points = torch.as_tensor(generator.uniform(-1, 1, (1, 400, 3)), dtype=torch.float32)
    with torch.inference_mode():
        target = network(points, covariates, latent)
    batch = Batch(points[:, :1], torch.ones(1, 1, 3), points.clone(), target.clone())
    only_distances = LossWeights(
        surface_eikonal=0.0, surface_distance=0.0, surface_normal=0.0, space_eikonal=0.0, latent=1e-4
    )
    config = FitConfig(steps=300, rate=2e-2)
    found = fit_latents(network, lambda rng: batch, covariates, config, only_distances)
    with torch.inference_mode():
        missed = (network(points, covariates, found) - target).abs().mean()
        without = (network(points, covariates, torch.zeros_like(found)) - target).abs().mean()
    assert missed < 0.2 * without + 1e-5
    given_up = Progress(is_unwanted=lambda: True)
    with pytest.raises(Cancelled):
        fit_latents(network, lambda rng: batch, covariates, config, only_distances, progress=given_up)


def test_damaged_samples_are_told_before_anything_is_written(egg_store, tmp_path):
    copied = shutil.copytree(egg_store.path, tmp_path / "store")
    store = SampleStore.open(copied)
    path = store.folder(int(np.flatnonzero(~np.asarray(store.population.held_out))[-1])) / "near.npy"
    samples = np.load(path)
    samples[-1] = np.nan
    np.save(path, samples)
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(InputError, match=r"near\.npy is damaged \(it holds what is no number"):
        train(store, egg_preset(epochs=1), tmp_path / "a.safetensors")
    assert [each for each in sorted(tmp_path.rglob("*")) if each not in before and each.is_file()] == []
