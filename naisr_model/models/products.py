"""Matrix products of many rows with a weight, by whichever library is faster on this processor.

On a CPU torch multiplies through MKL, which leaves the wide vector units of some processors idle;
oneDNN, which comes with torch as well, does not. Everywhere else the products are torch's own.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import torch
from torch import Tensor


class _Rows(torch.autograd.Function):
    """``rows @ weight + bias`` for a stack, as often differentiable as wanted."""

    @staticmethod
    def forward(ctx: Any, rows: Tensor, weight: Tensor, bias: Tensor | None) -> Tensor:
        ctx.save_for_backward(rows, weight)
        biases = [None] * len(rows) if bias is None else bias.unbind()
        products = [_by_onednn(*part) for part in zip(rows, weight, biases, strict=True)]
        return products[0].unsqueeze_(0) if len(products) == 1 else torch.stack(products)

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> Any:
        rows, weight = ctx.saved_tensors
        of_rows, of_weight, of_bias = ctx.needs_input_grad
        return (
            multiply(gradients[0], weight.mT) if of_rows else None,
            multiply(rows.mT, gradients[0]) if of_weight else None,
            gradients[0].sum(dim=1) if of_bias else None,
        )


def multiply(rows: Tensor, weight: Tensor, bias: Tensor | None = None) -> Tensor:
    """``rows @ weight + bias``, ``[stack, n, outputs]``.

    Args:
        rows: ``[stack, n, inputs]``.
        weight: ``[stack, inputs, outputs]``, of any strides.
        bias: ``[stack, outputs]``.
    """
    if rows.device.type == "cpu" and rows.dtype == torch.float32 and _onednn_multiplies():
        return _Rows.apply(rows, weight, bias)
    return torch.bmm(rows, weight) if bias is None else torch.baddbmm(bias[:, None], rows, weight)


@cache
def _onednn_multiplies() -> bool:
    """Whether this torch reaches oneDNN's product (its name is not part of torch's documented API)."""
    rows = torch.arange(6, dtype=torch.float32).reshape(3, 2)
    weight = torch.arange(8, dtype=torch.float32).reshape(2, 4)
    try:
        return torch.equal(_by_onednn(rows, weight, None), rows @ weight)
    except (AttributeError, RuntimeError, TypeError):
        return False


def _by_onednn(rows: Tensor, weight: Tensor, bias: Tensor | None) -> Tensor:
    return torch.ops.mkldnn._linear_pointwise(rows, weight.mT, bias, "none", [], "")
