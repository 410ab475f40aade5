"""A stand-in for a trained atlas whose surfaces are known in closed form, and windows that close."""

from __future__ import annotations

import gc
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PySide6.QtCore import QEvent, QSettings
from PySide6.QtWidgets import QApplication, QWidget
from pytestqt.qtbot import QtBot

from naisr_model.capabilities import Capabilities
from naisr_model.covariates import Covariate, Population
from naisr_model.errors import Cancelled, InputError
from naisr_model.frames import Frame
from naisr_model.progress import SILENT
from naisr_model.surface.displacements import DisplacementTables
from naisr_model.surface.tracking import Tracked
from naisr_viewer.control.controller import Controller
from naisr_viewer.control.preferences import Preferences
from naisr_viewer.control.worker import Worker
from naisr_viewer.engine.engine import Engine
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.views.main_window import MainWindow

AGE = Covariate("age", "months", "continuous", 100.0, 60.0, (1.0, 220.0))
WEIGHT = Covariate("weight", "kg", "continuous", 35.0, 20.0, (4.0, 95.0))
SEX = Covariate("sex", "", "binary", 0.0, 1.0, (-1.0, 1.0), ("F", "M"))
COVARIATES = (AGE, WEIGHT, SEX)

PATIENCE_MS = 60_000
"""Nothing that a test waits for takes so long, even on a slow machine that has other things to do."""


def people(count: int = 200) -> Population:
    """Children whose weight grows with their age."""
    rng = np.random.default_rng(0)
    age = rng.uniform(1, 220, count)
    weight = np.clip(4 + 0.31 * age + rng.normal(0, 3, count), 4, 95)
    sex = rng.choice([-1.0, 1.0], count)
    return Population(
        covariates=COVARIATES,
        subjects=tuple(f"s{i}" for i in range(count)),
        visits=("1",) * count,
        values=np.stack([age, weight, sex], axis=1),
        held_out=np.arange(count) % 5 == 0,
    )


class EllipsoidTracker:
    """Scales the template's vertices; what is older than 200 months counts as folded.

    ``began`` counts the previews, none of which is finished while ``gate`` is shut.
    """

    def __init__(self, template: trimesh.Trimesh, gate: threading.Event) -> None:
        self.template, self.gate = template, gate
        self.began = 0
        self.faces = np.asarray(template.faces, np.int64)
        self.template_points_mm = np.asarray(template.vertices, np.float32)

    def track(self, values, start=None):
        self.began += 1
        assert self.gate.wait(PATIENCE_MS / 1000)
        ratio = np.divide(EllipsoidAtlas.half_axes_mm(**values), EllipsoidAtlas.half_axes_mm())
        normals = self.template.vertex_normals / ratio
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        points_mm = (self.template.vertices * ratio).astype(np.float32)
        return Tracked(points_mm, normals.astype(np.float32), 0.0, values.get("age", 0.0) > 200)


class EllipsoidAtlas:
    """Ellipsoids: age makes them longer, weight wider, sex deeper.

    Half-axes in mm are (20 + 0.1 (weight - 35), 20 + 3 sex, 45 + 0.15 (age - 100)). No surface is finished
    while ``gate`` is shut, however long that is: it can only be given up.
    """

    def __init__(self, name: str = "ellipsoid") -> None:
        self.name = name
        self.population = people()
        self.covariates = COVARIATES
        self.capabilities = Capabilities(
            deformable=True,
            disentangleable=True,
            additive=True,
            evolvable=True,
            transferable=True,
            has_template=True,
            vanishes_at_centre=True,
        )
        self.frame = Frame((0.0, 0.0, 0.0), 100.0)
        self.gate, self.preview_gate = threading.Event(), threading.Event()
        self.gate.set()
        self.preview_gate.set()
        self.trackers: list[EllipsoidTracker] = []
        self.calls: list[tuple[str, dict[str, float], int]] = []
        self.running = 0
        self.cancelled = 0

    @staticmethod
    def half_axes_mm(
        age: float = 100.0, weight: float = 35.0, sex: float = 0.0
    ) -> tuple[float, float, float]:
        return 20 + 0.1 * (weight - 35), 20 + 3 * sex, 45 + 0.15 * (age - 100)

    def volume_cm3(self, **values: float) -> float:
        """The true volume."""
        return 4 / 3 * np.pi * float(np.prod(self.half_axes_mm(**values))) / 1000

    def template(self, resolution=128, *, progress=SILENT):
        return self._surface("template", {}, resolution, progress)

    def effect(
        self,
        name,
        value,
        latent=None,
        resolution=128,
        *,
        extrapolate=False,
        tracker=None,
        progress=SILENT,
    ):
        return self._surface(name, {name: value}, resolution, progress)

    def shape(
        self,
        covariates,
        latent=None,
        resolution=128,
        *,
        extrapolate=False,
        tracker=None,
        progress=SILENT,
    ):
        return self._surface("shape", dict(covariates), resolution, progress)

    def moved_mm(self, points_mm, covariates, latent=None):
        """Along the normals, since the ellipsoid at the centre."""
        ratio = np.divide(self.half_axes_mm(**covariates), self.half_axes_mm())
        return self._along(points_mm, np.asarray(points_mm) * (1 - 1 / ratio), covariates)

    def rates_mm(self, points_mm, name, covariates, latent=None):
        """A unit of the covariate farther, all else equal."""
        either = [{**covariates, name: covariates.get(name, 0.0) + side} for side in (-0.5, 0.5)]
        low, high = (np.array(self.half_axes_mm(**values)) for values in either)
        moved = np.asarray(points_mm) * (high - low) / self.half_axes_mm(**covariates)
        return self._along(points_mm, moved, covariates)

    def contrast_mm(self, points_mm, name, covariates, latent=None):
        low, high = (np.array(self.half_axes_mm(**{**covariates, name: end})) for end in (-1.0, 1.0))
        moved = np.asarray(points_mm) * (high - low) / self.half_axes_mm(**covariates)
        return self._along(points_mm, moved, covariates)

    def _along(self, points_mm, moved_mm, covariates):
        normals = np.asarray(points_mm) / np.square(self.half_axes_mm(**covariates))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return np.sum(moved_mm * normals, axis=1).astype(np.float32)

    def tabulate(self, template, latent=None, *, progress=SILENT):
        """Nothing needs to be tabulated: the tracker knows the ellipsoids."""
        self.calls.append(("tabulate", {}, 0))
        progress.check()
        return DisplacementTables(np.zeros((2, 3)), ())

    def tracker(self, template, tables):
        self.trackers.append(EllipsoidTracker(template, self.preview_gate))
        return self.trackers[-1]

    def _surface(self, what, values, resolution, progress):
        self.calls.append((what, values, resolution))
        self.running += 1
        try:
            progress.check()
            while not self.gate.wait(0.002):
                progress.check()
            progress.tell(1.0)
        except Cancelled:
            self.cancelled += 1
            raise
        finally:
            self.running -= 1
        mesh = trimesh.creation.icosphere(subdivisions=2 if resolution < 100 else 4)
        mesh.vertices *= self.half_axes_mm(**values)
        return mesh


class PatientBot(QtBot):
    """One whose waits end when something is wrong, not when a machine is slow."""

    def waitUntil(self, callback: Callable[[], bool | None], *, timeout: int = PATIENCE_MS) -> None:
        super().waitUntil(callback, timeout=timeout)

    def waitSignal(self, signal: Any, *, timeout: int = PATIENCE_MS, **options: Any) -> Any:
        return super().waitSignal(signal, timeout=timeout, **options)

    def waitExposed(self, widget: QWidget, *, timeout: int = PATIENCE_MS) -> Any:
        return super().waitExposed(widget, timeout=timeout)


@pytest.fixture
def qtbot(qapp: QApplication, request: pytest.FixtureRequest) -> QtBot:
    return PatientBot(request)


@pytest.fixture(autouse=True)
def no_traces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep tabulated displacements and sessions out of the folders of whoever runs the tests."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "user-cache"))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "user-state"))


@pytest.fixture(autouse=True)
def nothing_outlives_a_test(request: pytest.FixtureRequest) -> Iterator[None]:
    """No window, timer's owner or thread of ours is left when a test ends.

    Garbage is collected then, by the window's thread. A worker's thread could come to it in the middle of a
    test and delete what belongs to a closed window, whereupon Qt aborts the process.
    """
    before = set(threading.enumerate())
    gc.disable()
    yield
    request.node.funcargs.clear()  # else what the test was given lives on until the next one
    app = QApplication.instance()
    if isinstance(app, QApplication):
        gc.collect()
        app.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)
        left = [widget for widget in app.topLevelWidgets() if widget.parent() is None]
        assert left == []
    gc.enable()
    threads = [thread.name for thread in set(threading.enumerate()) - before]
    assert [name for name in threads if name.startswith("naisr")] == []


@pytest.fixture
def atlas() -> EllipsoidAtlas:
    return EllipsoidAtlas()


@pytest.fixture
def atlas_file(tmp_path: Path) -> Path:
    """A file that stands for the atlas; what is in it does not matter."""
    path = tmp_path / "ellipsoid.safetensors"
    path.write_bytes(b"stand-in")
    return path


@pytest.fixture
def engine(atlas: EllipsoidAtlas, tmp_path: Path) -> Engine:
    def load(path: Path):
        if path.read_bytes() != b"stand-in":
            raise InputError(f"{path.name} is not an atlas file; choose a .safetensors made by 'naisr train'")
        return atlas

    return Engine(load, tmp_path / "cache")


@pytest.fixture
def card(engine: Engine, atlas_file: Path) -> AtlasCard:
    return engine.open(atlas_file)


@pytest.fixture
def settings(tmp_path: Path) -> QSettings:
    return QSettings(str(tmp_path / "settings.ini"), QSettings.Format.IniFormat)


@pytest.fixture
def open_window(
    qtbot: QtBot, engine: Engine, settings: QSettings
) -> Iterator[Callable[..., tuple[MainWindow, Controller]]]:
    """Windows with a worker thread, closed at the end."""
    made = []

    def make(size: tuple[int, int] = (960, 640)) -> tuple[MainWindow, Controller]:
        window = MainWindow()
        controller = Controller(window, engine, Worker(), Worker(), Preferences(settings))
        made.append((window, controller))
        window.resize(*size)
        with qtbot.waitExposed(window):
            window.show()
        return window, controller

    yield make
    for window, _ in made:
        window.close()
        window.deleteLater()
    made.clear()
    qtbot.wait(0)
    gc.collect()
