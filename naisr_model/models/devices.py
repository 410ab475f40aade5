"""Where networks can be evaluated on this machine."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch

from naisr_model.errors import InputError


def usable_device(name: str | torch.device) -> torch.device:
    """The device called ``name``: cpu, cuda, cuda:1, mps.

    Raises:
        InputError: when there is no such device, or this torch cannot compute on it.
    """
    try:
        torch.ones(1, device=name).item()
    except (RuntimeError, AssertionError) as error:
        raise InputError(
            f"torch cannot compute on '{name}' here; choose {' or '.join(_usable_kinds())}"
        ) from error
    return torch.device(name)


def _usable_kinds() -> list[str]:
    found = {"cpu": True, "cuda": torch.cuda.is_available(), "mps": torch.backends.mps.is_available()}
    return [kind for kind, is_usable in found.items() if is_usable]


@contextmanager
def quick_products(device: str | torch.device) -> Iterator[None]:
    """Meanwhile, let a graphics card multiply with 10 bits behind the point (TF32), several times faster.

    Enough for a training, where every step is noise anyhow; shapes are evaluated without.
    """
    before = torch.get_float32_matmul_precision()
    if torch.device(device).type == "cuda":
        torch.set_float32_matmul_precision("high")
    try:
        yield
    finally:
        torch.set_float32_matmul_precision(before)
