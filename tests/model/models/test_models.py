"""What every model of the factory promises, held against its own plain evaluation in double precision."""

import dataclasses
from importlib import import_module
from types import MappingProxyType

import pytest
import torch

from naisr_model.config import Preset, TrainingConfig
from naisr_model.errors import InputError
from naisr_model.models import factory
from naisr_model.models.base import (
    AdditiveModel,
    DeformableModel,
    DisentangledModel,
    ShapeModel,
    additive,
    deformable,
    disentangled,
)
from naisr_model.models.derivatives import gradient
from naisr_model.models.factory import MODELS, build, model_class, preset, presets, read_preset

SHAPES, POINTS, COVARIATES = 3, 7, 2


def smallest(name: str) -> Preset:
    """The preset of a model whose networks have the fewest weights."""
    own = [one for one in presets().values() if one.model == name and one.network.dim == 3]
    return min(own, key=lambda one: sum(weight.numel() for weight in build(one, COVARIATES).parameters()))


def models_that(can: str) -> list[str]:
    """Names of the models with a capability; there has to be one, or nothing would be tested."""
    found = [name for name in MODELS if getattr(model_class(name).capabilities, can)]
    assert found
    return found


@pytest.fixture(params=MODELS)
def model(request) -> ShapeModel:
    torch.manual_seed(0)
    return build(smallest(request.param), COVARIATES).double()


@pytest.fixture
def arguments(model):
    generator = torch.Generator().manual_seed(1)

    def random(*size):
        return torch.rand(size, generator=generator, dtype=torch.float64) * 2 - 1

    count = COVARIATES if model.capabilities.evolvable else 0
    return random(SHAPES, POINTS, 3), random(SHAPES, count), 0.1 * random(SHAPES, model.config.latent)


def test_the_fast_way_gives_the_same_field(model, arguments):
    points, covariates, latents = arguments
    values = model(points, covariates, latents)
    for shape in range(SHAPES):
        fast = model.shape_function(covariates[shape], latents[shape])(points[shape])
        torch.testing.assert_close(fast, values[shape].detach(), rtol=0, atol=1e-12)


def test_the_linearised_field_is_that_of_autograd_and_of_finite_differences(model, arguments):
    points, covariates, latents = arguments
    local = model.linearised(points, covariates, latents)
    located = points.clone().requires_grad_()
    values = model(located, covariates, latents)
    torch.testing.assert_close(local.values, values)
    torch.testing.assert_close(local.slope, gradient(values, located))
    for axis in range(3):
        step = 1e-6 * torch.eye(3, dtype=torch.float64)[axis]
        up, down = (model(points + shift, covariates, latents) for shift in (step, -step))
        torch.testing.assert_close(local.slope[..., axis], (up - down) / 2e-6, atol=1e-6, rtol=1e-6)
    assert (local.template_slope is not None) == model.capabilities.has_template


def test_the_gradients_of_the_linearised_field_reach_every_weight(model, arguments):
    points, covariates, latents = arguments
    local = model.linearised(points, covariates, latents.requires_grad_())
    (local.values.square().mean() + local.slope.square().mean()).backward()
    assert latents.grad.abs().max() > 0
    for name, weight in model.named_parameters():
        assert weight.numel() == 0 or weight.grad is not None, name


def test_every_weight_has_one_learning_rate(model):
    rated = model.rated_parameters()
    assert set(rated) <= {field.name for field in dataclasses.fields(TrainingConfig)}
    listed = [id(weight) for own in rated.values() for weight in own]
    assert sorted(listed) == sorted(map(id, model.parameters()))


def test_capabilities_say_what_the_class_is(model):
    can = model.capabilities
    assert isinstance(model, DeformableModel) == can.deformable == can.has_template
    assert isinstance(model, DisentangledModel) == (can.deformable and can.disentangleable)
    assert isinstance(model, AdditiveModel) == can.additive == can.trackable
    assert can.trackable <= can.evolvable
    assert can.transferable <= can.evolvable
    assert can.vanishes_at_centre <= can.has_template


@pytest.mark.parametrize("model", models_that("vanishes_at_centre"), indirect=True)
def test_the_shape_at_the_centre_is_the_template_where_displacements_vanish(model, arguments):
    points, covariates, latents = arguments
    template = deformable(model).template(points)
    torch.testing.assert_close(model(points, torch.zeros_like(covariates), latents), template)


def test_what_a_model_is_not_is_refused_in_its_name():
    bare = build(preset("deepsdf-demo"), COVARIATES)
    for needed in (deformable, disentangled, additive):
        with pytest.raises(InputError, match=r"DeepSDF .*; ask for the shape itself"):
            needed(bare)
    flowing = build(preset("invertible-demo"), COVARIATES)
    with pytest.raises(InputError, match="NAISR, invertible does not add up the displacements"):
        additive(flowing)
    assert disentangled(flowing) is flowing
    whole = build(preset("demo"), COVARIATES)
    assert deformable(whole) is whole and additive(whole) is whole


@pytest.mark.parametrize("name", presets())
def test_a_preset_is_of_its_model_s_settings(name):
    assert type(preset(name).network) is model_class(preset(name).model).settings


def test_a_preset_of_two_models_is_a_mistake(monkeypatch):
    assert len(presets()) == sum(len(import_module(module).PRESETS) for module in MODELS.values())
    twice = {**MODELS, "other": MODELS["deepsdf"]}
    monkeypatch.setattr(factory, "MODELS", MappingProxyType(twice))
    with pytest.raises(ValueError, match="two models have a preset called deepsdf-demo and deepsdf-paper"):
        presets()


def test_a_record_that_names_no_model_is_naisr_s():
    record = {"network": {"latent": 8, "template": {"width": 32}}, "training": {"epochs": 3}}
    read = read_preset(record)
    assert read.model == "naisr" and (read.network.latent, read.training.epochs) == (8, 3)
    with pytest.raises(InputError, match=r"unknown setting 'network\.template'"):
        read_preset(record | {"model": "deepsdf"})


def test_unknown_models_and_presets_are_named():
    with pytest.raises(
        InputError, match=r"unknown shape model 'cubes'; known are asdf, deepsdf, dit, invertible, joint"
    ):
        model_class("cubes")
    with pytest.raises(InputError, match=r"no preset 'huge'; choose one of .*demo.*deepsdf-demo"):
        preset("huge")
