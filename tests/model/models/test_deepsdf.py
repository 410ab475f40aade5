"""DeepSDF: its one network written out, and what an atlas without template and covariates does."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import torch
from eggs import egg, egg_deepsdf_preset

from naisr_model.atlas import Atlas
from naisr_model.checkpoint import load
from naisr_model.config import SirenConfig
from naisr_model.errors import InputError
from naisr_model.learning.training.loop import train
from naisr_model.models.deepsdf import DeepSdf
from naisr_model.models.factory import build, preset
from naisr_model.models.single import SingleConfig

HELD_OUT = [(3.3, 1.0), (7.2, -1.0)]


@pytest.fixture(scope="module")
def path(egg_store, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("deepsdf") / "eggs.safetensors"
    train(egg_store, egg_deepsdf_preset(epochs=300), out)
    return out


@pytest.fixture(scope="module")
def atlas(path) -> Atlas:
    return Atlas.load(path)


def test_one_point_at_a_time_the_equations_give_the_same():
    torch.manual_seed(0)
    model = DeepSdf(SingleConfig(latent=5, shape=SirenConfig(16, 2, omega0=4.0)), 2).double()
    net, generator = model.network, torch.Generator().manual_seed(1)
    points, codes = (torch.randn(3, *rest, generator=generator).double() for rest in ((7, 3), (5,)))
    values = model(points, points.new_zeros(3, 0), codes)
    for shape, point in np.ndindex(3, 7):
        inputs = torch.cat([points[shape, point], codes[shape]])
        state = torch.cat([net.point_weight[0], net.condition_weight[0]], dim=1) @ inputs + net.first_bias[0]
        for layer in range(2):
            state = net.hidden_weight[layer, 0] @ torch.sin(4.0 * state) + net.hidden_bias[layer, 0]
        truth = net.last_weight[0] @ torch.sin(4.0 * state) + net.last_bias[0]
        torch.testing.assert_close(values[shape, point], truth[0], rtol=0, atol=1e-12)


def test_the_paper_s_network_has_eight_layers_of_512():
    width, latent = 512, 256
    expected = (3 + latent + 1) * width + 6 * (width + 1) * width + width + 1
    assert sum(weight.numel() for weight in build(preset("deepsdf-paper"), 3).parameters()) == expected


@pytest.mark.parametrize(("age", "sex"), HELD_OUT)
def test_a_held_out_egg_is_reconstructed_within_a_fortieth_of_its_radius(atlas, age, sex):
    truth, fit = egg(age, sex), atlas.fit(egg(age, sex))
    assert fit.residual_mm < 0.5
    assert np.abs(atlas.sdf(truth.vertices, {}, fit.latent)).mean() < 0.5
    shape = fit.shape(64)
    assert shape.is_watertight and shape.volume == pytest.approx(truth.volume, rel=0.03)
    assert shape.extents == pytest.approx(truth.extents, rel=0.05)
    average = atlas.shape({}, resolution=64)
    assert np.abs(average.extents - truth.extents).max() > 3 * np.abs(shape.extents - truth.extents).max()


def test_a_fit_has_nothing_to_infer_and_says_how_sure_it_is(atlas):
    fit = atlas.fit(egg(5.0, 1.0))
    assert fit.covariates == {} and fit.inferred == () and fit.intervals == {} and len(fit.alternatives) == 1
    low, high = fit.volume_interval_cm3
    assert low < fit.volume_cm3 < high and fit.surface_sd_mm([[20.0, 0.0, 0.0]]) > 0
    assert 0 <= fit.lasting <= 1
    assert np.array_equal(fit.at({}).latent, fit.latent)


def test_the_atlas_knows_what_it_is_not(atlas, egg_atlas):
    assert atlas.covariates == () and atlas.population.names == () and atlas.population.centre == {}
    assert len(atlas.population) == 24 and atlas.population.normalised().shape == (24, 0)
    can, could = atlas.capabilities, Atlas.load(egg_atlas).capabilities
    assert can.implicit and not (can.evolvable or can.has_template or can.trackable)
    assert could.evolvable and could.has_template and could.trackable


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda a: a.template(16), "DeepSDF deforms no template.*ask for the shape itself"),
        (lambda a: a.effect("age", 5.0), "DeepSDF does not tell covariates apart; ask for the whole shape"),
        (lambda a: a.tabulate(egg(5, 1)), "DeepSDF gives the covariates no displacements"),
        (lambda a: a.shape({"age": 5.0}), "DeepSDF depend on no covariates; leave out age"),
        (lambda a: a.sdf([[0, 0, 0]], {"age": 5.0, "sex": 1.0}), "leave out age, sex"),
        (lambda a: a.fit(egg(5, 1), {"age": 5.0}), "DeepSDF depend on no covariates; leave out age"),
        (lambda a: a.fit(egg(5, 1)).at({"age": 6.0}), "DeepSDF depend on no covariates; leave out age"),
        (lambda a: a.fit(egg(5, 1)).individual.tracker(egg(5, 1)), "DeepSDF gives the covariates no"),
    ],
)
def test_what_it_cannot_do_is_refused_in_a_sentence(atlas, ask, message):
    with pytest.raises(InputError, match=message):
        ask(atlas)


def test_its_checkpoint_keeps_everybody_s_covariates_and_no_folded_share(path):
    checkpoint = load(path)
    assert checkpoint.preset.model == "deepsdf" and checkpoint.population.names == ("age", "sex")
    assert set(checkpoint.training) == {"iterations", "seconds"}


@pytest.mark.parametrize(
    ("setting", "change"),
    [
        ("residual_latents", {"residual_latents": True}),
        ("population_share", {"population_share": 0.1}),
        ("template_epochs", {"template_epochs": (1,)}),
        ("displacement_rate", {"displacement_rate": 1e-3}),
        ("loss.ridge", {"ridge": 0.1}),
        ("loss.folding", {"folding": 0.1}),
        ("loss.template_eikonal", {"template_eikonal": 1.0}),
    ],
)
def test_settings_of_covariates_and_templates_are_refused(egg_store, tmp_path, setting, change):
    plain = egg_deepsdf_preset(epochs=1)
    training = plain.training
    if setting.startswith("loss"):
        training = dataclasses.replace(training, loss=dataclasses.replace(training.loss, **change))
    else:
        training = dataclasses.replace(training, **change)
    with pytest.raises(InputError, match=f"'training.{setting}' is .*, but DeepSDF has no use for it"):
        train(egg_store, dataclasses.replace(plain, training=training), tmp_path / "x.safetensors")
