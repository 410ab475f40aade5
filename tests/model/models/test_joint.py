"""One displacement of all covariates: its networks written out, and what its atlas does."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from eggs import egg

from naisr_model.atlas import Atlas
from naisr_model.config import SirenConfig
from naisr_model.errors import InputError
from naisr_model.models.factory import build, preset
from naisr_model.models.joint import Joint
from naisr_model.models.naisr.network import NaisrConfig


@pytest.fixture
def model() -> Joint:
    torch.manual_seed(0)
    sizes = NaisrConfig(
        latent=5, template=SirenConfig(16, 1, omega0=4.0), displacement=SirenConfig(12, 2, 3.0)
    )
    return Joint(sizes, 2).double()


@pytest.fixture
def inputs() -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(1)
    points, covariates, codes = (torch.randn(3, *rest, generator=generator) for rest in ((7, 3), (2,), (5,)))
    return points.double(), covariates.double(), codes.double()


def written_out(
    model: Joint, point: torch.Tensor, covariates: torch.Tensor, code: torch.Tensor
) -> torch.Tensor:
    """f of one point, layer by layer."""
    net = model.displacement_network
    inputs = torch.cat([point, covariates, code])
    state = torch.cat([net.point_weight[0], net.condition_weight[0]], dim=1) @ inputs + net.first_bias[0]
    for layer in range(2):
        linear = net.hidden_weight[layer, 0] @ torch.sin(3.0 * state) + net.hidden_bias[layer, 0]
        if layer == net.middle:
            linear = linear + net.skip_point_weight[0] @ point + net.skip_condition_weight[0] @ covariates
        state = linear
    return net.last_weight[0] @ torch.sin(3.0 * state) + net.last_bias[0]


def test_one_point_at_a_time_the_equation_gives_the_same(model, inputs):
    points, covariates, codes = inputs
    moved = model.displacement(points, covariates, codes)
    values = model(points, covariates, codes)
    for shape, point in np.ndindex(3, 7):
        one, code = points[shape, point], codes[shape]
        truth = written_out(model, one, covariates[shape], code) - written_out(
            model, one, 0 * covariates[0], code
        )
        torch.testing.assert_close(moved[shape, point], truth, rtol=0, atol=1e-12)
        torch.testing.assert_close(values[shape, point], model.template((one + truth)[None, None])[0, 0])


def test_the_slope_is_that_of_the_field_and_one_shape_is_the_same(model, inputs):
    points, covariates, codes = inputs
    found = model.linearised(points, covariates, codes)
    torch.testing.assert_close(found.values, model(points, covariates, codes))
    for axis, step in enumerate(1e-6 * torch.eye(3).double()):
        ahead, behind = (model(points + sign * step, covariates, codes) for sign in (1, -1))
        torch.testing.assert_close(found.slope[..., axis], (ahead - behind) / 2e-6, rtol=1e-6, atol=1e-8)
    torch.testing.assert_close(model.shape_function(covariates[1], codes[1])(points[1]), found.values[1])
    centre = model.shape_function(torch.zeros(2).double(), codes[1])(points[1])
    torch.testing.assert_close(centre, model.template(points[1:2])[0])


def test_nothing_is_displaced_at_the_centre_and_covariates_do_not_add_up(model, inputs):
    points, covariates, codes = inputs
    assert model.displacement(points, 0 * covariates, codes).abs().max() < 1e-12
    first, second = (covariates * torch.tensor(mask).double() for mask in ((1, 0), (0, 1)))
    apart = model.displacement(points, first, codes) + model.displacement(points, second, codes)
    assert not torch.allclose(apart, model.displacement(points, covariates, codes), rtol=1e-3)


def test_its_presets_are_those_of_naisr_without_what_only_a_sum_has():
    joint, plain = preset("joint-demo"), preset("demo")
    assert joint.network == plain.network and joint.training.epochs == plain.training.epochs
    assert joint.training.loss.ridge == joint.training.loss.centring == joint.training.population_share == 0
    one = sum(weight.numel() for weight in build(preset("joint-paper"), 1).parameters())
    assert one == sum(weight.numel() for weight in build(preset("paper-airway"), 1).parameters())


@pytest.mark.parametrize(("age", "sex"), [(3.3, 1.0), (7.2, -1.0)])
def test_covariates_give_the_egg_of_their_kind_and_a_patient_is_carried(egg_joint, age, sex):
    atlas, truth = Atlas.load(egg_joint), egg(age, sex)
    shape = atlas.shape({"age": age, "sex": sex}, resolution=64)
    assert shape.is_watertight and shape.volume == pytest.approx(truth.volume, rel=0.04)
    fit = atlas.fit(truth, {"age": age, "sex": sex})
    assert fit.residual_mm < 0.5
    later = fit.at({"age": 5.0, "sex": sex})
    assert later.volume_cm3 == pytest.approx(egg(5.0, sex).volume / 1000, rel=0.06)
    assert atlas.template(32).is_watertight


def test_what_needs_a_sum_is_refused_in_a_sentence(egg_joint):
    atlas = Atlas.load(egg_joint)
    assert atlas.capabilities.deformable and not atlas.capabilities.disentangleable
    with pytest.raises(InputError, match="NAISR, joint does not tell covariates apart"):
        atlas.effect("age", 5.0)
    with pytest.raises(InputError, match="NAISR, joint gives the covariates no displacements of their own"):
        atlas.tabulate(egg(5, 1))
