"""What every test may rely on."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
import trimesh
from eggs import egg, egg_deepsdf_preset, egg_preset

from naisr_model.data.prepare import PrepareOptions, prepare
from naisr_model.data.store import SampleStore
from naisr_model.learning.training.loop import train


@pytest.fixture(autouse=True, scope="session")
def one_thread() -> None:
    """Small networks are fastest on one thread, and results do not depend on the machine's cores."""
    torch.set_num_threads(1)


@pytest.fixture(scope="session")
def ball() -> trimesh.Trimesh:
    """A sphere about the origin, radius 10 mm; its volume is within 0.2 % of the true sphere's."""
    return trimesh.creation.icosphere(subdivisions=4, radius=10.0)


@pytest.fixture(scope="session")
def egg_table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twenty-four eggs as a user would bring them: STL files and a CSV."""
    folder = tmp_path_factory.mktemp("eggs")
    lines = ["mesh,subject,visit,age [years],sex"]
    for number in range(24):
        age, sex = 1 + 8 * number / 23, (-1, 1)[number % 2]
        egg(age, sex).export(folder / f"egg{number}.stl")
        lines.append(f"egg{number}.stl,S{number},1,{age:.3f},{'FM'[number % 2]}")
    (folder / "eggs.csv").write_text("\n".join(lines) + "\n")
    return folder / "eggs.csv"


@pytest.fixture(scope="session")
def egg_store(egg_table: Path, tmp_path_factory: pytest.TempPathFactory) -> SampleStore:
    """The eggs prepared for training."""
    out = tmp_path_factory.mktemp("store")
    prepare(egg_table, out, options=PrepareOptions(2000, 2000, 2000, workers=1))
    return SampleStore.open(out)


@pytest.fixture(scope="session")
def egg_atlas(egg_store: SampleStore, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An atlas of the eggs, trained for some seconds."""
    out = tmp_path_factory.mktemp("atlas") / "eggs.safetensors"
    train(egg_store, egg_preset(epochs=300), out)
    return out


@pytest.fixture(scope="session")
def egg_deepsdf(egg_store: SampleStore, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same of a model that depends on no covariates."""
    out = tmp_path_factory.mktemp("deepsdf") / "eggs.safetensors"
    train(egg_store, egg_deepsdf_preset(epochs=60), out)
    return out
