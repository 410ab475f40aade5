"""How distances change with covariates and code, against finite differences."""

import torch

from naisr_model.config import SirenConfig
from naisr_model.learning.fitting.sensitivity import sensitivity
from naisr_model.models.naisr.network import Naisr, NaisrConfig


def test_derivatives_are_those_of_finite_differences():
    torch.manual_seed(0)
    config = NaisrConfig(latent=3, template=SirenConfig(16, 1, 3.0), displacement=SirenConfig(8, 1, 2.0))
    network = Naisr(config, 2).double()
    for parameter in network.displacement_networks.parameters():
        torch.nn.init.normal_(parameter, std=0.1)
    generator = torch.Generator().manual_seed(1)
    points = torch.rand(700, 3, generator=generator, dtype=torch.float64) * 2 - 1
    theta = torch.tensor([0.3, -0.5, 0.2, 0.1, -0.4], dtype=torch.float64)
    local = sensitivity(network, points, theta[:2], theta[2:])

    def values(parameters):
        return network(points[None], parameters[None, :2], parameters[None, 2:])[0].detach()

    slope = values(theta) / local.distances
    for column in range(5):
        step = torch.zeros(5, dtype=torch.float64)
        step[column] = 1e-6
        expected = (values(theta + step) - values(theta - step)) / 2e-6
        assert torch.allclose(local.jacobian[:, column] * slope, expected, atol=1e-7)
