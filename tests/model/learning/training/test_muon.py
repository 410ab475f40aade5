"""Orthogonalised updates beside the singular value decomposition."""

import pytest
import torch

from naisr_model.learning.training.muon import MOMENTUM, Muon, orthogonalised


def test_every_matrix_of_a_stack_comes_near_to_its_orthogonal_factor():
    torch.manual_seed(0)
    matrices = torch.randn(2, 3, 12, 12, dtype=torch.float64)
    left, _, right = torch.linalg.svd(matrices)
    rotated = left.mT @ orthogonalised(matrices) @ right.mT
    values = rotated.diagonal(dim1=-2, dim2=-1)
    assert (rotated - torch.diag_embed(values)).abs().max() < 1e-9  # the same singular vectors
    assert values.min() > 0.3 and values.max() < 1.3  # the smallest of 12 may be on their way still
    assert values.median() == pytest.approx(0.9, abs=0.25)
    torch.testing.assert_close(orthogonalised(1e-3 * matrices), orthogonalised(matrices))
    assert orthogonalised(torch.zeros(1, 4, 4)).abs().max() == 0


def test_a_step_goes_its_rate_along_the_mean_that_looks_ahead():
    weight = torch.nn.Parameter(torch.zeros(1, 2, 2))
    muon = Muon([{"params": [weight], "lr": 0.5}])
    first, second = torch.tensor([[[3.0, 0.0], [0.0, 1.0]]]), torch.tensor([[[0.0, 2.0], [1.0, 0.0]]])
    mean, expected = torch.zeros(1, 2, 2), torch.zeros(1, 2, 2)
    for gradient in (first, second):
        weight.grad = gradient
        muon.step()
        mean = MOMENTUM * mean + (1 - MOMENTUM) * gradient
        expected = expected - 0.5 * orthogonalised(MOMENTUM * mean + (1 - MOMENTUM) * gradient)
        torch.testing.assert_close(weight.detach(), expected)
