"""The networks of NAISR against a plain, slow transcription of the paper's equations, in float64."""

import dataclasses

import numpy as np
import pytest
import torch

from naisr_model.config import SirenConfig
from naisr_model.models.derivatives import deformation_determinant, gradient, jacobian
from naisr_model.models.factory import build, preset
from naisr_model.models.naisr.inference import displacement_function
from naisr_model.models.naisr.network import Naisr, NaisrConfig
from naisr_model.models.siren import sine

SMALL = NaisrConfig(
    latent=5, template=SirenConfig(16, 2, omega0=4.0), displacement=SirenConfig(12, 3, omega0=2.0)
)


def make(dim=3, covariates=2):
    torch.manual_seed(0)
    return Naisr(dataclasses.replace(SMALL, dim=dim), covariates).double()


def arguments(dim=3, covariates=2, shapes=3, points=7):
    generator = torch.Generator().manual_seed(1)

    def random(*size):
        return torch.randn(size, generator=generator, dtype=torch.float64)

    return random(shapes, points, dim), random(shapes, covariates), random(shapes, SMALL.latent)


def plain_siren(net, index, point, condition):
    """One network of a stack on one point: the layer equations written out, nothing shared."""
    omega0, skip = net.omega0, condition[: net.skip_condition_weight.shape[-1]]
    first = torch.cat([net.point_weight[index], net.condition_weight[index]], dim=1)
    state = torch.sin(omega0 * (first @ torch.cat([point, condition]) + net.first_bias[index]))
    for layer in range(len(net.hidden_weight)):
        linear = net.hidden_weight[layer, index] @ state + net.hidden_bias[layer, index]
        if layer == net.middle and len(condition):
            again = torch.cat([net.skip_point_weight[index], net.skip_condition_weight[index]], dim=1)
            linear = linear + again @ torch.cat([point, skip])
        state = torch.sin(omega0 * linear)
    return net.last_weight[index] @ state + net.last_bias[index]


def assert_exact(got, expected):
    torch.testing.assert_close(got, expected, rtol=0, atol=1e-12)


def plain_template(network, point):
    return plain_siren(network.template_network, 0, point, torch.zeros(0, dtype=point.dtype))[0]


def plain_displacement(network, index, point, value, latent):
    at = [torch.cat([torch.stack([v]), latent]) for v in (value, torch.zeros_like(value))]
    f_value, f_zero = (plain_siren(network.displacement_networks, index, point, c) for c in at)
    return f_value - f_zero


@pytest.mark.parametrize("dim", [2, 3])
def test_training_and_inference_follow_the_equations_of_the_paper(dim):
    network, (points, covariates, latents) = make(dim), arguments(dim)
    values = network(points, covariates, latents)
    displacement = network.displacement(points, covariates, latents)
    for s in range(3):
        fused = displacement_function(network.displacement_networks, covariates[s], latents[s])(points[s])
        full, *effects = (
            network.shape_function(kept, latents[s])(points[s])
            for kept in (covariates[s], *torch.diag(covariates[s]))
        )
        for n in range(7):
            p, z = points[s, n], latents[s]
            g = [plain_displacement(network, i, p, covariates[s, i], z) for i in range(2)]
            template = [plain_template(network, p + d) for d in (*g, sum(g))]
            for got in (displacement[s, n], fused[n]):
                assert_exact(got, sum(g))
            for got in (values[s, n], full[n]):
                assert_exact(got, template[2])
            for got, expected in zip(effects, template, strict=False):
                assert_exact(got[n], expected)


def test_at_inference_a_covariate_at_its_centre_is_left_out(monkeypatch):
    network, (points, _, latents) = make(covariates=3), arguments(covariates=3)
    evaluated, product = set(), torch.baddbmm

    def counted(bias, state, weight):
        evaluated.add(len(state))
        return product(bias, state, weight)

    monkeypatch.setattr(torch, "baddbmm", counted)
    stack = network.displacement_networks
    displaced = displacement_function(stack, torch.tensor([0.0, 0.7, 0.0]), latents[0])(points[0])
    assert evaluated == {1}
    assert displaced.abs().max() > 1e-3
    assert (displacement_function(stack, torch.zeros(3), latents[0])(points[0]) == 0).all()


def test_a_covariate_at_its_centre_displaces_nothing_whatever_the_code():
    network, (points, covariates, latents) = make(), arguments()
    covariates[:, 1] = 0
    displacements = network.displacements(points, covariates, latents)
    assert displacements[0].abs().max() > 1e-3
    assert displacements[1].abs().max() < 1e-14


@pytest.mark.parametrize(
    ("name", "covariates", "published"),
    [("paper-airway", 3, 1.26e6), ("paper-hippocampus", 4, 2.26e6), ("paper-starman", 2, 1.33e6)],
)
def test_presets_have_the_published_number_of_parameters(name, covariates, published):
    network = build(preset(name), covariates)
    assert sum(p.numel() for p in network.parameters()) == pytest.approx(published, rel=0.01)


def test_sine_is_twice_differentiable():
    angle = torch.linspace(-4, 4, 9, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(sine, angle)
    assert torch.autograd.gradgradcheck(sine, angle)


def test_a_third_derivative_is_right_too():
    angle = torch.linspace(-4, 4, 9, dtype=torch.float64, requires_grad=True)
    derivative = sine(angle)
    for _ in range(3):
        derivative = torch.autograd.grad(derivative.sum(), angle, create_graph=True)[0]
    torch.testing.assert_close(derivative, -torch.cos(angle))


def test_gradients_agree_with_finite_differences():
    network, (points, covariates, latents) = make(), arguments()
    points.requires_grad_()
    values = network(points, covariates, latents)
    displacement = network.displacement(points, covariates, latents)
    slope, bend = gradient(values, points), jacobian(displacement, points)
    step = 1e-6
    for axis in range(3):
        shift = torch.zeros(3, dtype=torch.float64)
        shift[axis] = step
        up, down = (network(points + s, covariates, latents) for s in (shift, -shift))
        up_d, down_d = (network.displacement(points + s, covariates, latents) for s in (shift, -shift))
        torch.testing.assert_close(slope[..., axis], (up - down) / (2 * step), atol=1e-6, rtol=1e-6)
        torch.testing.assert_close(bend[..., axis], (up_d - down_d) / (2 * step), atol=1e-6, rtol=1e-6)


def test_the_chain_rule_gives_the_same_gradient():
    network, (points, covariates, latents) = make(), arguments()
    points.requires_grad_()
    values = network(points, covariates, latents)
    displacement = network.displacement(points, covariates, latents)
    local = network.linearised(points.detach(), covariates, latents)
    torch.testing.assert_close(local.values, values)
    torch.testing.assert_close(local.slope, gradient(values, points))
    deformed = (points + displacement).detach().requires_grad_()
    torch.testing.assert_close(local.template_slope, gradient(network.template(deformed), deformed))


def test_determinant_of_a_known_map():
    matrix = torch.tensor([[0.2, 0.1, 0.0], [0.0, -1.5, 0.3], [0.4, 0.0, 0.5]], dtype=torch.float64)
    points = torch.randn(1, 4, 3, dtype=torch.float64, requires_grad=True)
    determinant = deformation_determinant(points @ matrix.T, points)
    assert determinant.detach().numpy() == pytest.approx(np.linalg.det(np.eye(3) + matrix.numpy()))
    assert (determinant < 0).all()


def test_one_effect_at_several_values_is_that_effect_at_each():
    network, (points, covariates, latents) = make(), arguments()
    values = torch.tensor([-1.5, 0.0, 0.4, 2.0], dtype=torch.float64)
    found = network.effect_function(1, values, latents[0])(points[0])
    for value, displacement in zip(values, found, strict=True):
        alone = torch.zeros_like(covariates[:1])
        alone[0, 1] = value
        expected = network.displacements(points[:1], alone, latents[:1])[1, 0]
        torch.testing.assert_close(displacement, expected, rtol=0, atol=1e-12)
