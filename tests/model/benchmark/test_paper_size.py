"""Small networks at the paper's size have the same fields."""

import dataclasses

import pytest
import torch

from naisr_model.atlas import Atlas
from naisr_model.benchmark.paper_size import at_paper_size, paper_sized
from naisr_model.config import SirenConfig
from naisr_model.errors import InputError
from naisr_model.models.naisr.network import Naisr, NaisrConfig


@pytest.mark.parametrize("hidden", [1, 2, 3, 4])
@pytest.mark.parametrize("dim", [2, 3])
def test_the_paper_s_size_leaves_the_fields_as_they_are(hidden, dim):
    torch.manual_seed(hidden)
    config = NaisrConfig(dim, 6, SirenConfig(40, hidden, 10.0), SirenConfig(24, hidden, 3.0))
    small = Naisr(config, covariates=2)
    for weight in small.parameters():
        weight.data *= 1.3
    large = at_paper_size(small)
    assert large.config == dataclasses.replace(NaisrConfig(), dim=dim)
    points, covariates, codes = torch.rand(2, 500, dim) * 2 - 1, torch.randn(2, 2), torch.randn(2, 6)
    with torch.inference_mode():
        value, displacement = small(points, covariates, codes)
        same, as_far = large(points, covariates, torch.nn.functional.pad(codes, (0, 250)))
    assert displacement.abs().max() > 1e-3
    torch.testing.assert_close(same, value, atol=1e-5, rtol=0)
    torch.testing.assert_close(as_far, displacement, atol=1e-5, rtol=0)


def test_embedded_networks_work_without_denormal_numbers(egg_atlas):
    weights = paper_sized(Atlas.load(egg_atlas)).checkpoint.weights.values()
    tiny = torch.finfo(torch.float32).tiny
    assert all(((weight == 0) | (weight.abs() >= tiny)).all() for weight in weights)


def test_larger_networks_than_the_paper_s_are_refused():
    with pytest.raises(InputError, match="larger networks"):
        at_paper_size(Naisr(NaisrConfig(latent=300), covariates=1))
