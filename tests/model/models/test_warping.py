"""Templates met at points that an LSTM or a flow moves: beside torch's own cell and SciPy's integrator."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from eggs import egg, moved_as_in
from scipy.integrate import solve_ivp

from naisr_model.atlas import Atlas
from naisr_model.checkpoint import save
from naisr_model.config import SirenConfig
from naisr_model.errors import InputError
from naisr_model.models.derivatives import deformation_determinant
from naisr_model.models.dit import Dit, DitConfig
from naisr_model.models.factory import build, preset
from naisr_model.models.invertible import Invertible, InvertibleConfig
from naisr_model.models.ndf import Ndf, NdfConfig
from naisr_model.models.siren import SirenStack

TEMPLATE, MOVING = SirenConfig(16, 1, omega0=4.0), SirenConfig(12, 2, omega0=2.0)


def random(*size: int) -> torch.Tensor:
    return torch.randn(size, generator=torch.Generator().manual_seed(len(size)), dtype=torch.float64)


@pytest.fixture
def points() -> torch.Tensor:
    return 0.5 * random(3, 7, 3)


def test_dit_moves_points_as_an_lstm_says(points):
    torch.manual_seed(0)
    model, codes = Dit(DitConfig(latent=5, template=TEMPLATE, warp_width=9), 2).double(), random(3, 5)
    model.last_weight.data *= 100
    cell = torch.nn.LSTMCell(3 + 5, 9).double()
    cell.weight_ih.data = torch.cat([model.point_weight, model.code_weight], dim=1).data
    cell.weight_hh.data, cell.bias_ih.data = model.state_weight.data, model.gate_bias.data
    cell.bias_hh.data.zero_()
    for shape, code in zip(points, codes, strict=True):
        here, state = shape, (torch.zeros(7, 9).double(), torch.zeros(7, 9).double())
        for _ in range(8):
            state = cell(torch.cat([here, code.expand(7, 5)], dim=1), state)
            scale, shift = (state[0] @ model.last_weight.mT).chunk(2, dim=1)
            here = here + scale * here + shift
        moved = shape[None] + model.displacement(shape[None], random(1, 2), code[None])
        torch.testing.assert_close(moved[0], here, rtol=0, atol=1e-12)
        assert (here - shape).abs().max() > 0.05
    found = model.linearised(points, random(3, 2), codes)
    places = list(model.steps(points, codes))
    assert found.underway is not None
    torch.testing.assert_close(found.underway[1], model.template(places[3]))
    torch.testing.assert_close(found.displacement, places[-1] - points)


def followed(velocity, start: torch.Tensor, backwards: bool = False) -> torch.Tensor:
    """By another integrator, to eight digits."""

    def slope(_, flat):
        here = torch.from_numpy(flat).reshape(start.shape)
        with torch.no_grad():
            return (-1 if backwards else 1) * velocity(here).numpy().ravel()

    way = solve_ivp(slope, (0, 1), start.numpy().ravel(), rtol=1e-9, atol=1e-11)
    return torch.from_numpy(way.y[:, -1]).reshape(start.shape)


def test_ndf_moves_points_through_one_flow_after_the_other(points):
    torch.manual_seed(0)
    sizes = NdfConfig(latent=5, template=TEMPLATE, velocity=MOVING, blocks=3, steps=8)
    model, code = Ndf(sizes, 2).double(), random(3, 5)[:1]
    stacks = [block for block in model.modules() if isinstance(block, SirenStack)][1:]
    for block in stacks:
        block.last_weight.data *= 60
    here = points[:1]
    for block in stacks:
        here = followed(lambda at, block=block: block(at, code[None])[0], here)
    moved = points[:1] + model.displacement(points[:1], random(1, 2), code)
    assert (here - points[:1]).abs().max() > 0.05
    torch.testing.assert_close(moved.detach(), here, rtol=0, atol=1e-6)


@pytest.fixture
def invertible() -> Invertible:
    torch.manual_seed(0)
    sizes = InvertibleConfig(latent=5, template=TEMPLATE, displacement=MOVING, steps=8)
    model = Invertible(sizes, 2).double()
    model.velocity_networks.last_weight.data *= 60
    return model


def test_velocities_add_up_in_the_invertible_one_and_displacements_do_not(invertible, points):
    covariates, codes = random(3, 2), random(3, 5)
    networks = invertible.velocity_networks

    def sum_of(which):
        def velocity(here):
            total = torch.zeros_like(here)
            for index in which:
                for sign, value in ((1, covariates[:1, index]), (-1, torch.zeros(1).double())):
                    seen = torch.cat([value[None], codes[:1]], dim=1).expand(2, 1, 6)
                    total = total + sign * networks(here, seen)[index]
            return total

        return velocity

    start = points[:1]
    moved = start + invertible.displacement(start, covariates[:1], codes[:1])
    end = followed(sum_of((0, 1)), start)
    torch.testing.assert_close(moved.detach(), end, rtol=0, atol=1e-6)
    torch.testing.assert_close(followed(sum_of((0, 1)), end, backwards=True), start, rtol=0, atol=1e-7)
    alone = invertible.displacements(points, covariates, codes)
    for index in (0, 1):
        torch.testing.assert_close(
            start[0] + alone[index, 0].detach(), followed(sum_of((index,)), start)[0], rtol=0, atol=1e-6
        )
    assert (alone.sum(dim=0)[0] - (end - start)[0]).abs().max() > 1e-3
    assert invertible.displacement(points, 0 * covariates, codes).abs().max() < 1e-12


def test_nothing_folds_however_far_it_flows(invertible, points):
    invertible.velocity_networks.last_weight.data *= 4
    located = points.clone().requires_grad_()
    covariates, codes = 2 * random(3, 2), random(3, 5)
    moved = invertible.displacement(located, covariates, codes)
    assert moved.abs().max() > 0.5
    assert deformation_determinant(moved, located).min() > 0


def test_parameter_counts_are_those_that_were_published():
    def millions(name: str) -> float:
        return sum(weight.numel() for weight in build(preset(name), 3).parameters()) / 1e6

    assert millions("dit-paper") == pytest.approx(1.92, abs=0.01)  # Jiao et al., table of parameters
    assert millions("invertible-paper") == millions("paper-airway")


@pytest.mark.parametrize("model", ["dit", "ndf"])
def test_a_shape_that_the_atlas_can_make_is_fitted_by_its_code(model, egg_atlas, tmp_path):
    save(tmp_path / "a.safetensors", moved_as_in(model, egg_atlas))
    atlas = Atlas.load(tmp_path / "a.safetensors")
    code = atlas.checkpoint.latents[5]
    made = atlas.shape({}, code, resolution=64)
    assert made.is_watertight
    assert abs(made.volume / atlas.template(64).volume - 1) > 0.02
    fit = atlas.fit(made)
    assert fit.residual_mm < 0.1 and not atlas.covariates
    again = atlas.shape({}, fit.latent, resolution=64)
    assert again.volume == pytest.approx(made.volume, rel=0.01)
    with pytest.raises(InputError, match="does not tell covariates apart"):
        atlas.effect("age", 5.0)


def test_the_invertible_one_has_effects_and_a_patient_on_another_day(egg_invertible):
    atlas, truth = Atlas.load(egg_invertible), egg(3.3, 1.0)
    fit = atlas.fit(truth, {"age": 3.3, "sex": 1.0})
    assert fit.residual_mm < 0.5
    later = fit.at({"age": 7.2, "sex": 1.0})
    assert later.volume_cm3 == pytest.approx(egg(7.2, 1.0).volume / 1000, rel=0.1)
    older = atlas.effect("age", 8.0, resolution=64).extents / atlas.effect("age", 2.0, resolution=64).extents
    assert older[2] > 1.2 and older[:2] == pytest.approx(1, abs=0.08)
    with pytest.raises(InputError, match="does not add up the displacements"):
        atlas.tabulate(truth)
    centre = atlas.population.centre
    assert np.allclose(atlas.shape(centre, fit.latent, 48).volume, atlas.template(48).volume)
