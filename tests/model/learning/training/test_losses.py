"""Every loss term where its value is known in closed form."""

import numpy as np
import pytest
import torch

from naisr_model.benchmark.plain import PlainNaisr, plain_loss
from naisr_model.config import LossWeights, SirenConfig
from naisr_model.learning.training import losses
from naisr_model.learning.training.objective import Batch, latent_term, population_terms, reconstruction_terms
from naisr_model.learning.training.residual import covariate_basis, residual_latents
from naisr_model.models.naisr.network import Naisr, NaisrConfig


def test_a_sphere_s_distance_has_no_loss():
    points = torch.randn(2, 50, 3, dtype=torch.float64)
    unit = points / points.norm(dim=-1, keepdim=True)
    assert losses.eikonal(unit) == pytest.approx(0, abs=1e-12)
    assert losses.distance(points.norm(dim=-1) - 1, points.norm(dim=-1) - 1) == 0
    assert losses.normal(unit, unit) == pytest.approx(0, abs=1e-12)


def test_known_errors_have_known_losses():
    slope = torch.tensor([[[3.0, 4.0, 0.0], [0.0, 0.5, 0.0]]])
    assert losses.eikonal(slope) == pytest.approx((4 + 0.5) / 2)
    assert losses.distance(torch.tensor([0.2, -0.4]), 0.0) == pytest.approx(0.3)
    normals = torch.tensor([[[-3.0, -4.0, 0.0], [1.0, 0.0, 0.0]]])
    assert losses.normal(slope, normals) == pytest.approx((2 + 1) / 2)
    assert losses.latent_prior(torch.full((3, 4), 0.02), sigma=0.01) == pytest.approx(4)


def test_a_shrunk_template_has_no_first_order_loss_but_an_eikonal_one():
    points = torch.randn(1, 50, 3, dtype=torch.float64)
    distance, slope = points.norm(dim=-1) - 0.5, points / points.norm(dim=-1, keepdim=True)
    assert losses.first_order_distance(3 * distance, 3 * slope, distance, reach=0.1) == pytest.approx(
        0, abs=1e-12
    )
    assert losses.eikonal(3 * slope) == pytest.approx(2)
    far = losses.first_order_distance(
        torch.tensor([2.5]), torch.tensor([[1.0, 0, 0]]), torch.tensor([2.0]), 0.5
    )
    assert far == pytest.approx(0.5 / (1 + 2 / 0.5))


def test_centring_measures_what_two_levels_share():
    plus = torch.randn(2, 9, 3, dtype=torch.float64)
    assert losses.centring(-plus, plus) == pytest.approx(0, abs=1e-12)
    shared = torch.tensor([0.03, 0.0, 0.04], dtype=torch.float64)
    assert losses.centring(shared - plus, shared + plus) == pytest.approx(0.05, rel=0.01)
    assert losses.ridge(shared.expand(5, 3)) == pytest.approx(0.0025)


def test_folding_counts_only_negative_determinants():
    assert losses.folding(torch.tensor([1.0, 0.2, -0.6])) == pytest.approx(0.2)


def test_steps_underway_may_be_wrong_by_less_and_less():
    target = torch.tensor([[0.1, -0.1]])
    assert losses.underway(torch.stack([target + 0.02, target + 0.009, target - 0.002]), target) == 0
    outwards = torch.tensor([[0.125, -0.1]])  # farther outside than the first point is: the easy side
    inwards = torch.tensor([[0.075, -0.1]])  # nearer to the surface, or through it: the hard side
    easy, hard = (losses.underway(torch.stack([one] * 3), target) for one in (outwards, inwards))
    beyond = [0.0, 0.015 / 2, 0.0225 / 2]
    assert easy == pytest.approx((beyond[1] * 0.9 + beyond[2] * 0.8) / 3, rel=1e-5)
    assert hard == pytest.approx((beyond[1] * 1.1 + beyond[2] * 1.2) / 3, rel=1e-5)


def test_a_shift_of_everything_is_long_but_alike_and_a_stretch_is_not():
    points = torch.randn(2, 40, 3, dtype=torch.float64)
    shift = torch.tensor([0.06, 0.0, 0.08], dtype=torch.float64).expand_as(points)
    assert losses.pointwise(shift) == pytest.approx(0.1**2 / 2, rel=1e-5)
    assert losses.pointwise(10 * shift) == pytest.approx(0.25 * (1 - 0.125), rel=1e-5)
    assert losses.pointpair(shift, points) == 0
    assert losses.pointpair(0.4 * points, points) == 0
    assert losses.pointpair(0.8 * points, points) == pytest.approx(0.3, rel=1e-5)


def test_population_terms_push_the_template_to_the_middle_of_the_levels():
    config = NaisrConfig(latent=2, template=SirenConfig(8, 1, 5.0), displacement=SirenConfig(8, 1, 3.0))
    torch.manual_seed(0)
    network = Naisr(config, covariates=2)
    points, covariates = torch.rand(2, 30, 3), torch.tensor([[0.5, 1.0], [-0.2, -1.0]])
    weights = LossWeights(centring=1.0)
    optimiser = torch.optim.Adam(network.parameters(), 1e-2)

    def offset():
        return population_terms(network, points, covariates, (1,), weights)["centring"]

    before = float(offset().detach())
    for _ in range(100):
        optimiser.zero_grad()
        offset().backward()
        optimiser.step()
    assert float(offset().detach()) < 0.05 * before


def test_residual_codes_are_uncorrelated_with_functions_of_the_covariates():
    rng = np.random.default_rng(0)
    age, sex = rng.uniform(-1.7, 1.9, 200), rng.choice([-1.0, 1.0], 200)
    basis = covariate_basis(np.stack([age, sex], axis=1), binary=(1,))
    assert basis.T @ basis == pytest.approx(np.eye(basis.shape[1]), abs=1e-9)
    steep = np.exp(-3 * (age - age.min()))  # as infants grow: all of it happens at one end
    codes = torch.as_tensor(np.stack([steep + sex, rng.normal(size=200)], axis=1))
    residual = residual_latents(codes, torch.as_tensor(basis)).numpy()
    assert residual[:, 0].std() < 0.1 * steep.std()
    assert residual[:, 1].std() > 0.8
    for function in (np.ones(200), age, sex, age * sex):
        assert function @ residual == pytest.approx(0, abs=1e-9)


def test_a_small_population_keeps_codes_to_spare():
    basis = covariate_basis(np.random.default_rng(0).normal(size=(10, 3)), binary=())
    assert basis.shape[1] <= 2


@pytest.mark.parametrize("dim", [2, 3])
def test_the_loss_and_its_gradients_are_those_of_the_plain_equations(dim):
    config = NaisrConfig(
        dim, latent=5, template=SirenConfig(16, 2, omega0=4.0), displacement=SirenConfig(12, 3, omega0=2.0)
    )
    torch.manual_seed(0)
    network = Naisr(config, covariates=2).double()
    plain = PlainNaisr(network)
    surface, space = torch.rand(2, 3, 7, dim).double() * 2 - 1
    normals = torch.nn.functional.normalize(torch.randn(3, 7, dim).double(), dim=-1)
    batch = Batch(surface, normals, space, torch.rand(3, 7).double() - 0.5)
    covariates, latents = torch.randn(3, 2).double(), torch.randn(3, 5).double().requires_grad_()
    weights = LossWeights()
    terms = reconstruction_terms(network, batch, covariates, latents, weights) | latent_term(latents, weights)
    loss, truth = (
        torch.stack(list(terms.values())).sum(),
        plain_loss(plain, batch, covariates, latents, weights),
    )
    torch.testing.assert_close(loss, truth, rtol=1e-12, atol=1e-12)
    stack = network.displacement_networks
    ours = torch.autograd.grad(
        loss, [latents, stack.point_weight, stack.hidden_weight, network.template_network.hidden_weight]
    )
    named = dict(plain.named_parameters())
    first = [named[f"displacements.{index}.first.weight"] for index in range(2)]
    hidden = [weight for name, weight in named.items() if "displacements" in name and "hidden" in name]
    hidden = [weight for weight in hidden if weight.dim() == 2]
    hidden += [named[f"template.hidden.{layer}.weight"] for layer in range(2)]
    theirs = torch.autograd.grad(truth, [latents, *first, *hidden])
    torch.testing.assert_close(ours[0], theirs[0], rtol=1e-10, atol=1e-10)
    for index in range(2):
        torch.testing.assert_close(ours[1][index], theirs[1 + index][:, :dim], rtol=1e-10, atol=1e-10)
        for layer in range(3):
            expected = theirs[3 + 3 * index + layer][:, :12]
            torch.testing.assert_close(ours[2][layer, index], expected, rtol=1e-10, atol=1e-10)
    torch.testing.assert_close(ours[3][:, 0], torch.stack(theirs[-2:]), rtol=1e-10, atol=1e-10)


def test_single_precision_agrees_with_double():
    torch.manual_seed(0)
    network = Naisr(NaisrConfig(latent=4), covariates=2)
    normals = torch.nn.functional.normalize(torch.randn(2, 20, 3), dim=-1)
    batch = Batch(torch.rand(2, 20, 3), normals, torch.rand(2, 10, 3), torch.rand(2, 10))
    covariates, latents, weights = torch.randn(2, 2), torch.zeros(2, 4), LossWeights()
    gradients = []
    for kind in (torch.float32, torch.float64):
        network, batch = network.to(kind), Batch(*(part.to(kind) for part in batch))
        terms = reconstruction_terms(network, batch, covariates.to(kind), latents.to(kind), weights)
        inputs = [network.displacement_networks.hidden_weight, network.template_network.hidden_weight]
        gradients.append(torch.autograd.grad(torch.stack(list(terms.values())).sum(), inputs))
    for single, double in zip(*gradients, strict=True):
        assert (single - double).norm() < 1e-3 * double.norm()
