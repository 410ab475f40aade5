"""What every test may rely on."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest
import torch
import trimesh
from eggs import (
    egg,
    egg_asdf_preset,
    egg_deepsdf_preset,
    egg_joint_preset,
    egg_preset,
    ellipse,
    ellipse_preset,
    moved_as_in,
)
from filelock import FileLock

from naisr_model.checkpoint import save
from naisr_model.config import Preset
from naisr_model.data.prepare import PrepareOptions, prepare
from naisr_model.data.store import SampleStore
from naisr_model.learning.training.loop import train
from naisr_model.shapes.written import csv_bytes


@pytest.fixture(autouse=True, scope="session")
def one_thread() -> None:
    """Small networks are fastest on one thread, and results do not depend on the machine's cores."""
    torch.set_num_threads(1)


@pytest.fixture(scope="session")
def made_once(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, Callable[[Path], object]], Path]:
    """Makes a folder by its name; where tests run in several processes, one of them does it for all."""
    base = tmp_path_factory.getbasetemp()
    common = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base

    def folder(name: str, make: Callable[[Path], object]) -> Path:
        place, done = common / name, common / f"{name}.done"
        with FileLock(common / f"{name}.lock"):
            if not done.exists():
                place.mkdir(exist_ok=True)
                make(place)
                done.touch()
        return place

    return folder


@pytest.fixture(scope="session")
def ball() -> trimesh.Trimesh:
    """A sphere about the origin, radius 10 mm; its volume is within 0.2 % of the true sphere's."""
    return trimesh.creation.icosphere(subdivisions=4, radius=10.0)


@pytest.fixture(scope="session")
def egg_table(made_once) -> Path:
    """Twenty-four eggs as a user would bring them: STL files and a CSV."""

    def make(folder: Path) -> None:
        lines = ["mesh,subject,visit,age [years],sex"]
        for number in range(24):
            age, sex = 1 + 8 * number / 23, (-1, 1)[number % 2]
            egg(age, sex).export(folder / f"egg{number}.stl")
            lines.append(f"egg{number}.stl,S{number},1,{age:.3f},{'FM'[number % 2]}")
        (folder / "eggs.csv").write_text("\n".join(lines) + "\n")

    return Path(made_once("eggs", make) / "eggs.csv")


@pytest.fixture(scope="session")
def egg_store(egg_table: Path, made_once) -> SampleStore:
    """The eggs prepared for training."""
    options = PrepareOptions(2000, 2000, 2000, workers=1)
    return SampleStore.open(made_once("egg-store", lambda out: prepare(egg_table, out, options=options)))


@pytest.fixture(scope="session")
def ellipses(made_once) -> Path:
    """A folder with twenty curves ``c0.csv`` ..., their store, and an atlas of them, ``a.safetensors``."""

    def make(folder: Path) -> None:
        lines = ["mesh,subject,age [years]"]
        for number in range(20):
            age = 1 + 8 * number / 19
            (folder / f"c{number}.csv").write_bytes(csv_bytes(ellipse(age)))
            lines.append(f"c{number}.csv,s{number},{age}")
        (folder / "ellipses.csv").write_text("\n".join(lines))
        options = PrepareOptions(1000, 1000, 1000, 0.2, workers=1)
        assert not prepare(folder / "ellipses.csv", folder / "store", options=options).rejected
        train(SampleStore.open(folder / "store"), ellipse_preset(), folder / "a.safetensors")

    return Path(made_once("ellipses", make))


@pytest.fixture(scope="session")
def trained(egg_store: SampleStore, made_once) -> Callable[[Preset], Path]:
    """An atlas of the eggs by a preset, trained for some seconds, once for each model."""

    def atlas(preset: Preset) -> Path:
        file = "eggs.safetensors"
        return Path(made_once(f"egg-{preset.model}", lambda out: train(egg_store, preset, out / file)) / file)

    return atlas


@pytest.fixture(scope="session")
def egg_atlas(trained) -> Path:
    """Of NAISR."""
    return Path(trained(egg_preset(epochs=300)))


@pytest.fixture(scope="session")
def egg_deepsdf(trained) -> Path:
    """Of a model that depends on no covariates."""
    return Path(trained(egg_deepsdf_preset(epochs=60)))


@pytest.fixture(scope="session")
def egg_asdf(trained) -> Path:
    """Of a model that depends on covariates and has no template."""
    return Path(trained(egg_asdf_preset(epochs=300)))


@pytest.fixture(scope="session")
def egg_joint(trained) -> Path:
    """Of a model that has a template and one displacement of all covariates."""
    return Path(trained(egg_joint_preset(epochs=300)))


@pytest.fixture(scope="session")
def egg_invertible(egg_atlas, made_once) -> Path:
    """Of a model that tells covariates apart and does not add up their displacements."""
    file = "eggs.safetensors"

    made = made_once("egg-invertible", lambda out: save(out / file, moved_as_in("invertible", egg_atlas)))
    return Path(made / file)


@pytest.fixture
def no_room() -> Callable[[int], AbstractContextManager[None]]:
    """``with no_room(bytes):`` no file grows beyond that, as on a full disk; nor of processes begun there."""
    resource = pytest.importorskip("resource", reason="there is no limit for files")

    @contextmanager
    def limited(most: int) -> Iterator[None]:
        hard = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, hard))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))

    return limited
