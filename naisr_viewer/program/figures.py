"""The pictures of the window in the documents: ``python -m naisr_viewer.program.figures FOLDER``.

A child of the synthetic population that the atlas has never seen is written as a hospital would hand the scan
over, opened in the window, moved onto the atlas by its landmarks, fitted, and carried three years ahead.
"""

from __future__ import annotations

import csv
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from naisr_model.shipped import shipped_atlas
from naisr_viewer.control.controller import Controller
from naisr_viewer.program import start
from naisr_viewer.program.display import ensure_display
from naisr_viewer.program.headless import finish, take_screenshot
from naisr_viewer.state.drawer import Tab
from naisr_viewer.state.explorer import ExplorerState, opened, with_values
from naisr_viewer.state.layouts import FULL_SHAPE, Layout
from naisr_viewer.state.overlay import Quantity
from naisr_viewer.state.patients import Named, Reading
from naisr_viewer.state.support import Support
from naisr_viewer.views.main_window import MainWindow

PIXELS = (1280, 800)
SHOWN = {"age": 60.0, "weight": 19.0, "sex": -1.0}
MAN: Named = (("arms", 0.6), ("legs", -0.6))
HARDLY_ANYONE: Named = (("age", 70.0), ("weight", 48.0))
WIDENED_MM, RING_MM = 2.0, 4.0
OTHER_SEED, AGE_MONTHS, LATER_MONTHS = 1000, 90.0, 36.0


@dataclass(frozen=True)
class Child:
    """A scan as it comes: files in the frame of the scanner, and what is known of the child."""

    mesh: Path
    landmarks: Path
    known: Named


def main(folder: Path) -> None:
    """Write ``window.png`` and ``patient.png`` into a folder, and those of the user guide under ``docs``."""
    pictures = folder / "docs" / "pictures"
    pictures.mkdir(parents=True, exist_ok=True)
    ensure_display(PIXELS)
    engine = start.make_engine("cpu")
    card = engine.open(shipped_atlas())
    with TemporaryDirectory() as scans, start.own_window(engine) as (window, controller):
        window.resize(*PIXELS)
        window.show()
        first = with_values(opened(ExplorerState(), card), tuple(SHOWN.items()))
        controller.begin(first)
        take_screenshot(window, controller, folder / "window.png")
        for name, scene in SCENES.items():
            controller.begin(first)
            scene(window, controller)
            take_screenshot(window, controller, pictures / f"{name}.png")
        controller.begin(first)
        child = _child(Path(scans))
        _fit(window, controller, child)
        _fit(window, controller, _widened(child))
        window.patients.compared_chosen.emit(1)
        controller.set_layout(Layout.CHANGE)
        take_screenshot(window, controller, pictures / "scans.png")
        controller.begin(first)
        _fit(window, controller, child)
        window.patients.reveal_standings()
        take_screenshot(window, controller, pictures / "usual.png")
        controller.set_follow(True)
        controller.set_layout(Layout.CHANGE)
        controller.settle("age", dict(controller.state.named)["age"] + LATER_MONTHS)
        take_screenshot(window, controller, folder / "patient.png")
        controller.begin(with_values(opened(ExplorerState(), engine.open(shipped_atlas("starman"))), MAN))
        controller.set_quantity(Quantity.DISPLACEMENT)
        take_screenshot(window, controller, pictures / "plane.png")


def _pin_three_places(window: MainWindow, controller: Controller) -> None:
    """At the upper and the lower end, and half way between."""
    finish(window, controller)
    surface = controller.shown[FULL_SHAPE]
    for share in (0.75, 0.45, 0.1):
        height_mm = np.quantile(surface.points_mm[:, 2], share)
        nearest = np.argmin(np.abs(surface.points_mm[:, 2] - height_mm))
        window.shapes.clicked.emit(FULL_SHAPE, tuple(surface.points_mm[nearest].tolist()))
        finish(window, controller)


def _go_where_nobody_is(_window: MainWindow, controller: Controller) -> None:
    """Among the people behind the atlas: as heavy as hardly anyone of that age."""
    controller.set_support(Support("age", "weight", is_open=True))
    controller.settle_all(HARDLY_ANYONE)


def _show_maps(_window: MainWindow, controller: Controller) -> None:
    """How far each point has moved."""
    controller.set_quantity(Quantity.DISPLACEMENT)


def _lay_out(_window: MainWindow, controller: Controller) -> None:
    """By age and weight."""
    controller.set_layout(Layout.MATRIX)


def _show_curve(window: MainWindow, controller: Controller) -> None:
    """How the volume changes with age."""
    controller.set_drawer(Tab.CURVE)
    finish(window, controller)


SCENES = {
    "point": _pin_three_places,
    "support": _go_where_nobody_is,
    "maps": _show_maps,
    "curve": _show_curve,
    "matrix": _lay_out,
}
"""The pictures of the user guide, by name; each scene starts from what ``window.png`` shows."""


def _child(folder: Path) -> Child:
    """Of ten new children the boy whose age is nearest to the one that is wanted."""
    command = [sys.executable, "-m", "naisr_model.cli", "populate", "airway", str(folder)]
    subprocess.run([*command, "--patients", "10", "--seed", str(OTHER_SEED)], check=True, capture_output=True)
    (table,) = folder.glob("*.csv")
    with table.open(newline="", encoding="utf-8") as file:
        rows = [_plain(row) for row in csv.DictReader(file)]
    boys = [row for row in rows if row["sex"] == "M"]
    row = min(boys, key=lambda row: abs(float(row["age"]) - AGE_MONTHS))
    known = (("age", float(row["age"])), ("weight", float(row["weight"])), ("sex", 1.0))
    return Child(folder / row["mesh"], folder / row["landmarks"], known)


def _widened(child: Child) -> Child:
    """The same child with a ring about the middle of the airway widened by 2 mm."""
    import trimesh

    mesh = trimesh.load_mesh(child.mesh)
    height = mesh.vertices[:, 2] - np.quantile(mesh.vertices[:, 2], 0.4)
    mesh.vertices += WIDENED_MM * np.exp(-((height / RING_MM) ** 2))[:, None] * mesh.vertex_normals
    file = child.mesh.with_name("widened.ply")
    mesh.export(file)
    return replace(child, mesh=file)


def _plain(row: dict[str, str]) -> dict[str, str]:
    """A row by the names of its columns, without their units."""
    return {name.partition(" [")[0]: value for name, value in row.items()}


def _fit(window: MainWindow, controller: Controller, child: Child) -> None:
    """What a user does: open the scan, align it, say what is known, and fit."""
    window.scan_requested.emit(child.mesh)
    finish(window, controller)
    window.patients.reading_changed.emit(Reading(child.mesh, align="landmarks", landmarks=child.landmarks))
    finish(window, controller)
    window.patients.known.give(child.known)
    window.patients.known.fit.click()
    finish(window, controller)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
