"""What every test may rely on."""

from __future__ import annotations

import pytest
import torch
import trimesh


@pytest.fixture(autouse=True, scope="session")
def one_thread() -> None:
    """Small networks are fastest on one thread, and results do not depend on the machine's cores."""
    torch.set_num_threads(1)


@pytest.fixture(scope="session")
def ball() -> trimesh.Trimesh:
    """A sphere about the origin, radius 10 mm; its volume is within 0.2 % of the true sphere's."""
    return trimesh.creation.icosphere(subdivisions=4, radius=10.0)
