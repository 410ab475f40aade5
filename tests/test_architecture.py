"""The import arrows of the house: who may know of whom, read from the source with ``ast``."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

FLOORS = {
    "naisr_model": (
        ("__init__",),
        (
            *("errors", "files", "exports", "shipped", "terminal", "records", "covariates", "numerals"),
            *("frames", "config", "progress", "capabilities"),
        ),
        ("work",),
        ("shapes",),
        ("data",),
        ("models",),
        ("surface",),
        ("checkpoint",),
        ("learning",),
        ("atlas",),
        ("measures",),
        ("patients",),
        ("evaluation",),
        ("cohorts",),
        ("benchmark",),
        ("cli",),
    ),
    "naisr_viewer": (
        ("__init__",),
        ("state",),
        ("engine", "words"),
        ("panels",),
        ("files", "views"),
        ("control",),
        ("program",),
        ("app",),
        ("__main__",),
    ),
}
"""Each package from the ground up. A room is a folder or a file, with all that will ever be in it; it may
know what lies below, and in the model, whose floors are wider, what stands beside it without a cycle."""

QT = ("PySide6", "PySide2", "PyQt5", "PyQt6", "shiboken6", "qtpy", "pyqtgraph", "pyvistaqt")


@dataclass(frozen=True)
class Rule:
    """``importers`` may not import anything under ``forbidden``, except what is under ``allowed``."""

    importers: tuple[str, ...]
    forbidden: tuple[str, ...]
    allowed: tuple[str, ...] = ()
    but_not: tuple[str, ...] = ()


COVARIATES = "naisr_model.covariates"
VOCABULARY = (COVARIATES, "naisr_model.capabilities", "naisr_model.frames")
LIGHT = tuple(
    f"naisr_model.{name}"
    for name in ("errors", "exports", "files", "progress", "records", "shipped", "terminal")
)
"""What anybody may use."""

DRAWS_CURVES = ("naisr_viewer.files.surfaces", "naisr_viewer.files.figure")
CANVAS = "naisr_viewer.views.shapes.canvas"
NO_QT = tuple(f"naisr_viewer.{room}*" for room in ("state", "words", "engine", "panels", "files"))
SPEAKS_OF_COVARIATES = tuple(
    f"naisr_viewer.{room}*" for room in ("state", "words", "panels", "files", "views")
)
GROUND = ("naisr_model", *(f"naisr_model.{name}" for name in FLOORS["naisr_model"][1]))

ANY_MODEL = tuple(f"naisr_model.models.{name}" for name in ("base", "factory", "devices", "derivatives"))
"""What may be known of shape models by whoever works with all of them; the rest is of some, or of one."""

RULES = (
    Rule(("naisr_model*",), (*QT, "naisr_viewer")),
    Rule(
        ("naisr_model*", "naisr_viewer*"),
        ("naisr_model.models",),
        allowed=ANY_MODEL,
        # What the benchmark measures against, the equations written plainly and the paper's size, is NAISR's.
        but_not=("naisr_model.models.*", "naisr_model.benchmark.*"),
    ),
    Rule(GROUND, ("torch",)),
    Rule(
        ("naisr_viewer.*",),
        ("naisr_model",),
        allowed=LIGHT,
        but_not=("naisr_viewer.engine*", *SPEAKS_OF_COVARIATES),
    ),
    Rule(
        SPEAKS_OF_COVARIATES,
        ("naisr_model",),
        allowed=(*LIGHT, *VOCABULARY),
        but_not=DRAWS_CURVES,
    ),
    # Curves have no library of their own, as surfaces have trimesh.
    Rule(
        DRAWS_CURVES,
        ("naisr_model",),
        allowed=(*LIGHT, *VOCABULARY, "naisr_model.shapes"),
    ),
    Rule(("naisr_viewer*",), ("torch",)),
    Rule(("naisr_viewer*",), ("pyvistaqt",), but_not=(CANVAS,)),
    Rule(("naisr_viewer*",), ("pyqtgraph",), but_not=("naisr_viewer.views.charts*",)),
    Rule(NO_QT, QT),
    Rule(("naisr_viewer.views*", "naisr_viewer.panels*"), ("naisr_viewer.engine",)),
    Rule(("naisr_viewer.control.worker",), ("naisr_viewer.engine", "naisr_viewer.views", COVARIATES)),
)


def module_name(path: Path, root: Path) -> str:
    """``root/a/b.py`` is ``a.b``; ``root/a/__init__.py`` is ``a``."""
    parts = path.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def source_files(root: Path) -> dict[str, Path]:
    """Every module of the two packages under ``root`` by its dotted name."""
    files = [file for package in ("naisr_model", "naisr_viewer") for file in (root / package).rglob("*.py")]
    return {module_name(file, root): file for file in files}


def absolute(node: ast.ImportFrom, module: str, is_package: bool) -> str:
    """The dotted name that ``from <this> import ...`` stands for in ``module``."""
    if not node.level:
        return node.module or ""
    up = node.level - is_package
    parts = module.split(".")
    return ".".join([*parts[: len(parts) - up], *filter(None, [node.module])])


def raw_imports(module: str, file: Path) -> Iterator[str]:
    """Dotted names that a module imports anywhere in its text, functions and type checks included."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"), str(file))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = absolute(node, module, file.name == "__init__.py")
            yield from (f"{base}.{alias.name}" for alias in node.names)


def resolve(name: str, modules: Mapping[str, Path]) -> str:
    """``naisr_model.frames.Frame`` is the module ``naisr_model.frames``; foreign names stay as they are."""
    while name.startswith(("naisr_model.", "naisr_viewer.")) and name not in modules:
        name = name.rpartition(".")[0]
    return name


def import_graph(root: Path) -> dict[str, set[str]]:
    """Imported modules by importing module."""
    modules = source_files(root)
    return {
        module: {resolve(name, modules) for name in raw_imports(module, file)} - {module}
        for module, file in modules.items()
    }


def under(name: str, roots: tuple[str, ...]) -> bool:
    return any(name == root or name.startswith(root + ".") for root in roots)


def matches(name: str, patterns: tuple[str, ...]) -> bool:
    return any(fnmatchcase(name, pattern) for pattern in patterns)


def rule_violations(graph: Mapping[str, set[str]]) -> list[str]:
    return [
        f"{importer} must not import {name}"
        for rule in RULES
        for importer, names in graph.items()
        if matches(importer, rule.importers) and not matches(importer, rule.but_not)
        for name in sorted(names)
        if under(name, rule.forbidden) and not under(name, rule.allowed)
    ]


def package_of(module: str) -> str:
    return module.partition(".")[0]


def floor(module: str) -> int | None:
    """Height of a module of ours in its package, or None where no floor names its room."""
    package, room = [*module.split("."), "__init__"][:2]
    heights = enumerate(FLOORS[package])
    return next((height for height, rooms in heights if room in rooms), None)


def room(module: str) -> str:
    return ".".join(module.split(".")[:2])


def unplaced(graph: Mapping[str, set[str]]) -> list[str]:
    return [f"{module} stands on no floor" for module in graph if floor(module) is None]


def floor_violations(graph: Mapping[str, set[str]]) -> list[str]:
    return [
        f"{module} must not import {name}, which is {where}"
        for module, names in graph.items()
        for name in sorted(names & graph.keys())
        if package_of(module) == package_of(name) and (where := misplaced(module, name))
    ]


def misplaced(module: str, name: str) -> str:
    """What is wrong with the height of ``name`` for ``module``; empty where nothing is."""
    here, there = floor(module) or 0, floor(name) or 0
    if there > here:
        return "on a higher floor"
    is_beside = there == here and room(module) != room(name)
    return "another room of its floor" if is_beside and package_of(module) == "naisr_viewer" else ""


def cycles(graph: Mapping[str, set[str]]) -> list[str]:
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return ["import cycle: " + " -> ".join(reversed(error.args[1]))]
    return []


def violations(root: Path) -> list[str]:
    """Every broken arrow in the tree at ``root``, as sentences."""
    graph = import_graph(root)
    return [*rule_violations(graph), *unplaced(graph), *floor_violations(graph), *cycles(graph)]


def made_up_tree(root: Path, sources: Mapping[str, str]) -> Path:
    for name, text in sources.items():
        file = root / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
    return root


SOUND = {
    "naisr_model/__init__.py": "",
    "naisr_model/errors.py": "",
    "naisr_model/files.py": "",
    "naisr_model/covariates.py": "from naisr_model.errors import InputError",
    "naisr_model/data/__init__.py": "from .store import Store",
    "naisr_model/data/store.py": "from naisr_model import covariates\nfrom . import tables",
    "naisr_model/data/tables.py": "import numpy as np",
    "naisr_model/models/naisr/network.py": "import torch\nfrom naisr_model.covariates import Covariate",
    "naisr_model/models/base.py": "import torch",
    "naisr_model/models/naisr/__init__.py": "",
    "naisr_model/models/cubes.py": "from naisr_model.models.base import ShapeModel",
    "naisr_model/atlas.py": "import torch\nfrom naisr_model.models.base import ShapeModel",
    "naisr_model/benchmark/plain.py": "from naisr_model.models.naisr.network import Naisr",
    "naisr_model/cli/__init__.py": "from naisr_model.cli import atlases",
    "naisr_model/cli/atlases.py": "def info():\n    from naisr_model.atlas import Atlas",
    "naisr_viewer/__init__.py": "from naisr_model import __version__",
    "naisr_viewer/state/explorer.py": "from naisr_model.covariates import Covariate",
    "naisr_viewer/words/numbers.py": "from naisr_viewer.state import explorer",
    "naisr_viewer/engine/engine.py": "from naisr_model.atlas import Atlas",
    "naisr_viewer/engine/clinic.py": "from .engine import Engine\nimport naisr_model.patients.intake",
    "naisr_viewer/panels/base.py": "from naisr_viewer.words import numbers",
    "naisr_viewer/files/surfaces.py": "from naisr_model.files import replacing",
    "naisr_viewer/views/window.py": "from naisr_model.covariates import Covariate\nimport PySide6",
    "naisr_viewer/views/shapes/canvas.py": "from pyvistaqt import QtInteractor",
    "naisr_viewer/control/worker.py": "from PySide6.QtCore import QObject\nimport naisr_model.errors",
    "naisr_viewer/control/controller.py": "from naisr_viewer.engine import engine\nfrom . import worker",
    "naisr_viewer/program/start.py": "from naisr_viewer.control import controller",
    "naisr_viewer/app.py": "from .program.start import start",
    "naisr_viewer/__main__.py": "from naisr_viewer.app import main",
}
"""A house in miniature that keeps every rule."""

BROKEN = {
    "a model that knows Qt": ("naisr_model/atlas.py", "import PySide6.QtCore"),
    "a model that knows the viewer": ("naisr_model/cli/atlases.py", "import naisr_viewer.app"),
    "torch on the ground floor": ("naisr_model/covariates.py", "from torch import nn"),
    "an import upwards": ("naisr_model/data/store.py", "from naisr_model.models.naisr import network"),
    "an atlas of one model": ("naisr_model/atlas.py", "from naisr_model.models.naisr.network import Naisr"),
    "a study of one model": ("naisr_model/evaluation/new.py", "from naisr_model.models import naisr"),
    "a training of a new model": (
        "naisr_model/learning/new.py",
        "from naisr_model.models.cubes import Cubes",
    ),
    "a viewer of one model": ("naisr_viewer/engine/new.py", "import naisr_model.models.cubes"),
    "an import upwards inside a function": (
        "naisr_model/errors.py",
        "def f():\n    import naisr_model.atlas",
    ),
    "a relative import upwards": ("naisr_model/data/store.py", "from .. import atlas"),
    "a root package that pulls in the rest": ("naisr_model/__init__.py", "from .atlas import Atlas"),
    "a cycle inside a folder": ("naisr_model/data/tables.py", "import naisr_model.data.store"),
    "a cycle on the ground floor": ("naisr_model/errors.py", "from naisr_model import covariates"),
    "a module on no floor": ("naisr_model/helpers.py", ""),
    "a viewer's module on no floor": ("naisr_viewer/helpers.py", ""),
    "a controller that knows the model": ("naisr_viewer/control/controller.py", "import naisr_model.atlas"),
    "a controller that computes": ("naisr_viewer/control/controller.py", "import torch"),
    "a state that knows the atlas": ("naisr_viewer/state/new.py", "from naisr_model.atlas import Atlas"),
    "a state that knows words": ("naisr_viewer/state/new.py", "from naisr_viewer.words import numbers"),
    "a view that knows the atlas": ("naisr_viewer/views/new/a.py", "from naisr_model.atlas import Atlas"),
    "a view that knows the controller": ("naisr_viewer/views/new/a.py", "from ...control import controller"),
    "a view that knows the engine": ("naisr_viewer/views/new/a.py", "from naisr_viewer.engine import clinic"),
    "a view that writes files": ("naisr_viewer/views/new/a.py", "from naisr_viewer.files import surfaces"),
    "a panel that knows the engine": ("naisr_viewer/panels/new.py", "import naisr_viewer.engine.engine"),
    "an engine that knows panels": ("naisr_viewer/engine/new.py", "from naisr_viewer.panels import base"),
    "an engine that knows words": ("naisr_viewer/engine/new.py", "from naisr_viewer.words import numbers"),
    "a room that knows the program": (
        "naisr_viewer/control/new.py",
        "from naisr_viewer.program import start",
    ),
    "Qt in the clinic": ("naisr_viewer/engine/clinic.py", "from PySide6.QtCore import QObject"),
    "a desk that knows the model": ("naisr_viewer/control/desk.py", "import naisr_model.patients.intake"),
    "a second door to pyvistaqt": ("naisr_viewer/views/shapes/new.py", "from pyvistaqt import QtInteractor"),
    "a second door to pyqtgraph": ("naisr_viewer/views/drawer.py", "import pyqtgraph"),
    "Qt in the state": ("naisr_viewer/state/explorer.py", "from PySide6.QtGui import QColor"),
    "Qt in the engine by way of qtpy": ("naisr_viewer/engine/engine.py", "from qtpy import QtCore"),
    "Qt in the files": ("naisr_viewer/files/new.py", "import PySide6"),
    "a worker that knows the engine": (
        "naisr_viewer/control/worker.py",
        "from naisr_viewer.engine.engine import run",
    ),
    "a worker that knows the model": (
        "naisr_viewer/control/worker.py",
        "from naisr_model.covariates import Population",
    ),
}


def test_the_arrows_hold() -> None:
    assert "\n".join(violations(ROOT)) == ""


def test_both_packages_were_read() -> None:
    assert {"naisr_model.covariates", "naisr_viewer.state.explorer"} <= set(source_files(ROOT))


def test_a_sound_house_passes(tmp_path: Path) -> None:
    assert not violations(made_up_tree(tmp_path, SOUND))


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_arrow_is_found(case: str, tmp_path: Path) -> None:
    file, text = BROKEN[case]
    found = violations(made_up_tree(tmp_path, {**SOUND, file: text}))
    assert len(found) >= 1
    assert any(module_name(tmp_path / file, tmp_path) in sentence for sentence in found)


def test_the_vocabulary_loads_without_torch() -> None:
    modules = ", ".join(f"naisr_model.{name}" for name in FLOORS["naisr_model"][1])
    check = f"import sys, {modules}; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", check], check=False).returncode == 0
