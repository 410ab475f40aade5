"""Orthogonalised updates of weight matrices: Muon (Jordan et al. 2024), a whole stack of matrices at once.

torch's own takes single matrices; here the layers of all networks of a model are one tensor.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import torch
from torch import Tensor

MOMENTUM = 0.95

NEWTON_SCHULZ = 3.4445, -4.7750, 2.0315
"""Coefficients of the published iteration, and how often it is taken."""

STEPS = 5


class Muon(torch.optim.Optimizer):
    """Every matrix moves by its rate along the orthogonal factor of its gradient's running mean.

    Args:
        groups: parameters ``[..., n, m]`` with their ``lr``, as torch's optimisers take them.
    """

    def __init__(self, groups: Iterable[dict[str, Any]]) -> None:
        super().__init__(groups, {"lr": 0.0})

    @torch.no_grad()
    def step(self, closure: Callable[[], float] | None = None) -> None:  # type: ignore[override]
        """One update of all parameters that have a gradient."""
        for group in self.param_groups:
            for parameter in group["params"]:
                if parameter.grad is None:
                    continue
                mean = self.state[parameter].setdefault("momentum", torch.zeros_like(parameter))
                mean.lerp_(parameter.grad, 1 - MOMENTUM)
                ahead = parameter.grad.lerp(mean, MOMENTUM)  # Nesterov's form
                parameter.sub_(group["lr"] * orthogonalised(ahead))


def orthogonalised(matrices: Tensor) -> Tensor:
    """Near to U V^T of each matrix U S V^T, ``[..., n, m]``: all singular values from about 0.7 to 1.2."""
    first, second, third = NEWTON_SCHULZ
    result = matrices / matrices.norm(dim=(-2, -1), keepdim=True).clamp(min=1e-12)
    for _ in range(STEPS):
        square = result @ result.mT
        result = first * result + (second * square + third * square @ square) @ result
    return result
