"""A patient who was really fitted."""

from __future__ import annotations

from pathlib import Path

import pytest
from eggs import egg

from naisr_model.progress import Progress
from naisr_viewer.engine.clinic import Clinic
from naisr_viewer.engine.engine import Engine
from naisr_viewer.state.explorer import ExplorerState, opened, with_patient
from naisr_viewer.state.patients import OpenScan, Reading

KNOWN = (("age", 6.0), ("sex", 1.0))


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("scans") / "s25.stl"
    egg(6.0, 1.0).export(path)
    return path


@pytest.fixture(scope="module")
def desk(egg_atlas: Path, file: Path, tmp_path_factory: pytest.TempPathFactory):
    """Engine, clinic, and the state after a fit."""
    engine = Engine(folder=tmp_path_factory.mktemp("cache"))
    clinic = Clinic(engine)
    state = opened(ExplorerState(), engine.open(egg_atlas))
    reading = Reading(file)
    scan = clinic.read(egg_atlas, reading, KNOWN)
    told: list[float] = []
    fit, _ = clinic.fit(egg_atlas, scan, KNOWN, Progress(told.append))
    assert told == sorted(told) and told[-1] == pytest.approx(1)
    return engine, clinic, with_patient(state, OpenScan(1, file.name, reading, scan, KNOWN, fit))
