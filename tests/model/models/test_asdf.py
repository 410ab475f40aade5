"""A-SDF: its one network written out, and what an atlas with covariates and without a template does."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from eggs import egg

from naisr_model import cli
from naisr_model.atlas import Atlas
from naisr_model.checkpoint import load
from naisr_model.config import SirenConfig
from naisr_model.errors import InputError
from naisr_model.models.asdf import ASdf
from naisr_model.models.factory import build, preset
from naisr_model.models.single import SingleConfig


@pytest.fixture(scope="module")
def atlas(egg_asdf) -> Atlas:
    return Atlas.load(egg_asdf)


def test_one_point_at_a_time_the_equations_give_the_same():
    torch.manual_seed(0)
    model = ASdf(SingleConfig(latent=5, shape=SirenConfig(16, 2, omega0=4.0)), 2).double()
    net, generator = model.network, torch.Generator().manual_seed(1)
    points, covariates, codes = (
        torch.randn(3, *rest, generator=generator).double() for rest in ((7, 3), (2,), (5,))
    )
    values = model(points, covariates, codes)
    for shape, point in np.ndindex(3, 7):
        inputs = torch.cat([points[shape, point], covariates[shape], codes[shape]])
        state = torch.cat([net.point_weight[0], net.condition_weight[0]], dim=1) @ inputs + net.first_bias[0]
        for layer in range(2):
            state = net.hidden_weight[layer, 0] @ torch.sin(4.0 * state) + net.hidden_bias[layer, 0]
        truth = net.last_weight[0] @ torch.sin(4.0 * state) + net.last_bias[0]
        torch.testing.assert_close(values[shape, point], truth[0], rtol=0, atol=1e-12)


def test_covariates_and_code_tell_shapes_apart_the_slope_is_that_of_the_field():
    torch.manual_seed(0)
    model = ASdf(SingleConfig(latent=5, shape=SirenConfig(16, 2, omega0=4.0)), 2).double()
    points, covariates, codes = (
        torch.randn(2, 6, 3).double(),
        torch.randn(2, 2).double(),
        torch.randn(2, 5).double(),
    )
    values = model(points, covariates, codes)
    assert not torch.allclose(values, model(points, covariates + 0.1, codes))
    assert not torch.allclose(values, model(points, covariates, codes + 0.1))
    found = model.linearised(points, covariates, codes)
    assert found.template_slope is None
    torch.testing.assert_close(found.values, values)
    for axis, step in enumerate(1e-6 * torch.eye(3).double()):
        ahead, behind = (model(points + sign * step, covariates, codes) for sign in (1, -1))
        torch.testing.assert_close(found.slope[..., axis], (ahead - behind) / 2e-6, rtol=1e-6, atol=1e-8)
    with torch.no_grad():
        one = model.shape_function(covariates[1], codes[1])(points[1])
    torch.testing.assert_close(one, values[1])


def test_the_paper_s_network_has_eight_layers_of_512():
    width, latent = 512, 256
    expected = (3 + 3 + latent + 1) * width + 6 * (width + 1) * width + width + 1
    assert sum(weight.numel() for weight in build(preset("asdf-paper"), 3).parameters()) == expected


@pytest.mark.parametrize(("age", "sex"), [(3.3, 1.0), (7.2, -1.0)])
def test_covariates_alone_give_the_average_egg_of_their_kind(atlas, age, sex):
    truth = egg(age, sex)
    shape = atlas.shape({"age": age, "sex": sex}, resolution=64)
    assert shape.is_watertight and shape.volume == pytest.approx(truth.volume, rel=0.04)
    assert shape.extents == pytest.approx(truth.extents, rel=0.05)


def test_a_patient_is_fitted_with_known_covariates_and_seen_at_another_age(atlas):
    fit = atlas.fit(egg(3.3, 1.0), {"age": 3.3, "sex": 1.0})
    assert fit.residual_mm < 0.5
    later = fit.at({"age": 7.2, "sex": 1.0})
    assert later.volume_cm3 == pytest.approx(egg(7.2, 1.0).volume / 1000, rel=0.06)


def test_unknown_covariates_are_inferred_with_their_interval(atlas):
    fit = atlas.fit(egg(6.5, 1.0))
    assert set(fit.inferred) == {"age", "sex"}
    low, high = fit.intervals["age"]
    assert low <= 6.5 <= high and high - low < 6


def test_the_atlas_knows_what_it_is_not(atlas, egg_asdf):
    can = atlas.capabilities
    assert can.evolvable and can.transferable
    assert not (can.deformable or can.disentangleable or can.has_template or can.trackable)
    assert [each.name for each in atlas.covariates] == ["age", "sex"]
    assert load(egg_asdf).preset.model == "asdf"
    for ask in (
        lambda: atlas.template(16),
        lambda: atlas.effect("age", 5.0),
        lambda: atlas.tabulate(egg(5, 1)),
    ):
        with pytest.raises(InputError, match="A-SDF"):
            ask()


def test_a_binary_covariate_has_to_be_given_as_nothing_is_known_between_its_levels(
    egg_asdf, tmp_path, capsys
):
    out = tmp_path / "egg.stl"
    assert cli.main(["mesh", str(egg_asdf), "--set", "age=5", "--out", str(out)]) == 2
    assert "A-SDF knows no shape between the levels of 'sex'; give F or M" in capsys.readouterr().err
    assert not out.exists()
    assert cli.main(["mesh", str(egg_asdf), "--set", "age=5,sex=M", "--out", str(out)]) == 0
    assert out.exists()
