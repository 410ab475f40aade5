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

FLOORS = (
    ("__init__",),
    ("errors", "files", "shipped", "covariates", "frames", "config"),
    ("data",),
    ("networks",),
    ("surface",),
    ("checkpoint",),
    ("learning",),
    ("atlas",),
    ("evaluation",),
    ("cli",),
)
"""``naisr_model`` from the ground up; modules and folders on one row may not form a cycle."""

QT = ("PySide6", "PySide2", "PyQt5", "PyQt6", "shiboken6", "qtpy", "pyqtgraph", "pyvistaqt")


@dataclass(frozen=True)
class Rule:
    """``importers`` may not import anything under ``forbidden``, except what is under ``allowed``."""

    importers: tuple[str, ...]
    forbidden: tuple[str, ...]
    allowed: tuple[str, ...] = ()
    but_not: tuple[str, ...] = ()


COVARIATES = "naisr_model.covariates"
ERRORS = "naisr_model.errors"
LIGHT = tuple(f"naisr_model.{name}" for name in ("errors", "files", "shipped"))
"""What anybody may use."""

VIEWS = "naisr_viewer.views"
CANVAS = "naisr_viewer.views.canvas"
NUMERICAL = tuple(f"naisr_viewer.{name}" for name in ("engine", "previews", "surfaces", "members", "clinic"))
"""Where the viewer meets the model."""

QUIET = ("state", "requests", "patients", "words", "captions", "status", "cache", "export")
NO_QT = (*NUMERICAL, *(f"naisr_viewer.{name}" for name in QUIET))
DRIVERS = tuple(
    f"naisr_viewer.{name}" for name in ("app", "controller", "desk", "jobs", "preferences", "worker")
)
GROUND = ("naisr_model", *(f"naisr_model.{name}" for name in FLOORS[1]))

RULES = (
    Rule(("naisr_model*",), (*QT, "naisr_viewer")),
    Rule(GROUND, ("torch",)),
    Rule(
        ("naisr_viewer*",),
        ("naisr_model",),
        allowed=LIGHT,
        but_not=(*NUMERICAL, "naisr_viewer.state", VIEWS + "*"),
    ),
    Rule(("naisr_viewer.state", VIEWS + "*"), ("naisr_model",), allowed=(ERRORS, COVARIATES)),
    Rule(("naisr_viewer*",), ("torch",)),
    Rule(("naisr_viewer*",), ("pyvistaqt",), but_not=(CANVAS,)),
    Rule(NO_QT, (*QT, VIEWS)),
    Rule(("naisr_viewer.worker",), ("naisr_viewer.engine", VIEWS)),
    Rule((VIEWS + "*",), (*DRIVERS, *NUMERICAL)),
    Rule(("naisr_viewer*",), ("naisr_viewer.app",), but_not=("naisr_viewer.__main__",)),
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


def floor(module: str) -> int | None:
    """Height of a ``naisr_model`` module, or None where no floor names it."""
    entry = [*module.split("."), "__init__"][1]
    return next((height for height, entries in enumerate(FLOORS) if entry in entries), None)


def unplaced(graph: Mapping[str, set[str]]) -> list[str]:
    ours = [module for module in graph if under(module, ("naisr_model",))]
    return [f"{module} stands on no floor" for module in ours if floor(module) is None]


def floor_violations(graph: Mapping[str, set[str]]) -> list[str]:
    return [
        f"{module} must not import {name}, which is on a higher floor"
        for module, names in graph.items()
        if under(module, ("naisr_model",))
        for name in sorted(names)
        if under(name, ("naisr_model",)) and (floor(name) or 0) > (floor(module) or 0)
    ]


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
    "naisr_model/covariates.py": "from naisr_model.errors import InputError",
    "naisr_model/data/__init__.py": "from .store import Store",
    "naisr_model/data/store.py": "from naisr_model import covariates\nfrom . import tables",
    "naisr_model/data/tables.py": "import numpy as np",
    "naisr_model/networks/naisr.py": "import torch\nfrom naisr_model.covariates import Covariate",
    "naisr_model/atlas.py": "import torch\nfrom naisr_model.networks.naisr import Naisr",
    "naisr_model/cli/__init__.py": "from naisr_model.cli import atlases",
    "naisr_model/cli/atlases.py": "def info():\n    from naisr_model.atlas import Atlas",
    "naisr_viewer/__init__.py": "",
    "naisr_viewer/state.py": "from naisr_model.covariates import Covariate",
    "naisr_viewer/engine.py": "from naisr_model.atlas import Atlas",
    "naisr_viewer/clinic.py": "from naisr_viewer.engine import Engine\nimport naisr_model.evaluation.intake",
    "naisr_viewer/worker.py": "from PySide6.QtCore import QObject\nfrom naisr_model.errors import Cancelled",
    "naisr_viewer/controller.py": "from naisr_viewer import engine, state, worker",
    "naisr_viewer/views/__init__.py": "",
    "naisr_viewer/views/panel.py": "from naisr_model.covariates import Covariate\nimport PySide6",
    "naisr_viewer/views/canvas.py": "from pyvistaqt import QtInteractor",
    "naisr_viewer/app.py": "from .controller import Controller",
    "naisr_viewer/__main__.py": "from naisr_viewer.app import main",
}
"""A house in miniature that keeps every rule."""

BROKEN = {
    "a model that knows Qt": ("naisr_model/atlas.py", "import PySide6.QtCore"),
    "a model that knows the viewer": ("naisr_model/cli/atlases.py", "import naisr_viewer.app"),
    "torch on the ground floor": ("naisr_model/covariates.py", "from torch import nn"),
    "an import upwards": ("naisr_model/data/store.py", "from naisr_model.networks import naisr"),
    "an import upwards inside a function": (
        "naisr_model/errors.py",
        "def f():\n    import naisr_model.atlas",
    ),
    "a relative import upwards": ("naisr_model/data/store.py", "from .. import atlas"),
    "a root package that pulls in the rest": ("naisr_model/__init__.py", "from .atlas import Atlas"),
    "a cycle inside a folder": ("naisr_model/data/tables.py", "import naisr_model.data.store"),
    "a cycle on the ground floor": ("naisr_model/errors.py", "from naisr_model import covariates"),
    "a module on no floor": ("naisr_model/helpers.py", ""),
    "a controller that knows the model": ("naisr_viewer/controller.py", "import naisr_model.atlas"),
    "a controller that computes": ("naisr_viewer/controller.py", "import torch"),
    "a state that knows the atlas": ("naisr_viewer/state.py", "from naisr_model.atlas import Atlas"),
    "a view that knows the atlas": ("naisr_viewer/views/panel.py", "from naisr_model.atlas import Atlas"),
    "a view that knows the controller": ("naisr_viewer/views/panel.py", "from .. import controller"),
    "a view that knows the clinic": ("naisr_viewer/views/panel.py", "from naisr_viewer.clinic import Clinic"),
    "Qt in the clinic": ("naisr_viewer/clinic.py", "from PySide6.QtCore import QObject"),
    "a desk that knows the model": ("naisr_viewer/desk.py", "import naisr_model.evaluation.intake"),
    "a second door to pyvistaqt": ("naisr_viewer/controller.py", "from pyvistaqt import QtInteractor"),
    "Qt in the state": ("naisr_viewer/state.py", "from PySide6.QtGui import QColor"),
    "Qt in the engine by way of qtpy": ("naisr_viewer/engine.py", "from qtpy import QtCore"),
    "Qt in the requests": ("naisr_viewer/requests.py", "import PySide6"),
    "a worker that knows the engine": ("naisr_viewer/worker.py", "from naisr_viewer.engine import run"),
    "a worker that knows the model": (
        "naisr_viewer/worker.py",
        "from naisr_model.covariates import Population",
    ),
}


def test_the_arrows_hold() -> None:
    assert "\n".join(violations(ROOT)) == ""


def test_both_packages_were_read() -> None:
    assert {"naisr_model.covariates", "naisr_viewer.state"} <= set(source_files(ROOT))


def test_a_sound_house_passes(tmp_path: Path) -> None:
    assert not violations(made_up_tree(tmp_path, SOUND))


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_arrow_is_found(case: str, tmp_path: Path) -> None:
    file, text = BROKEN[case]
    found = violations(made_up_tree(tmp_path, {**SOUND, file: text}))
    assert len(found) >= 1
    assert any(module_name(tmp_path / file, tmp_path) in sentence for sentence in found)


def test_the_vocabulary_loads_without_torch() -> None:
    modules = ", ".join(f"naisr_model.{name}" for name in FLOORS[1])
    check = f"import sys, {modules}; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", check], check=False).returncode == 0
