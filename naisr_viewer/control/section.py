"""The section plane: what the bar says becomes the state, and every surface that is shown is cut by it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject

from naisr_viewer.control.controller import Controller
from naisr_viewer.engine.sections import cut_of
from naisr_viewer.panels.kinds import visible_panels
from naisr_viewer.state.camera import Triple
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.requests import SurfaceResult
from naisr_viewer.state.section import Plane, Section, facing, section_of
from naisr_viewer.views.main_window import MainWindow

ROUND_TO = 0.1
"""Share of what can be cut, to whose decade the slider's ends are rounded: it rests while shapes move."""


class SectionDesk(QObject):
    """Wires the bar of the section plane.

    Args:
        window: shows the plane and the cuts.
        controller: holds the state; it owns this.
    """

    def __init__(self, window: MainWindow, controller: Controller) -> None:
        super().__init__(controller)
        self._window, self._controller = window, controller
        self._before: ExplorerState | None = None
        self._shown: Section | None = None
        window.section_switched.connect(self.switch)
        window.section_chosen.connect(self.choose)
        window.section_moved.connect(self.move)
        window.section_settled.connect(self.settle)
        window.section_flipped.connect(self.flip)
        controller.changed.connect(self.follow)
        controller.refinement.surface_shown.connect(self.cut)

    def switch(self) -> None:
        """Cut the shapes through their middle, or no more."""
        if self._controller.state.section is None:
            self.choose(Plane.SAGITTAL)
        else:
            self._commit(None)

    def choose(self, plane: Plane) -> None:
        """Have the plane lie another way, through the middle of what is shown."""
        box_mm = self._box_mm()
        if box_mm is not None:
            x, y, z = box_mm.mean(axis=1).tolist()
            self._commit(section_of(plane, facing(self._window.shapes.camera), (x, y, z)))

    def move(self, offset_mm: float) -> None:
        """The plane is on its way."""
        state = self._controller.state
        if state.section is not None:
            self._before = self._before or state
            self._controller.go(replace(state, section=replace(state.section, offset_mm=offset_mm)))

    def settle(self, offset_mm: float) -> None:
        """The plane came to rest; what lies behind is one step to undo."""
        self.move(offset_mm)
        if self._before is not None:
            before, self._before = self._before, None
            self._controller.conclude(before, self._controller.state)

    def flip(self) -> None:
        """Show what was cut away, and cut away what was shown."""
        section = self._controller.state.section
        if section is not None:
            self._commit(replace(section, is_low_cut=not section.is_low_cut))

    def follow(self, state: ExplorerState) -> None:
        """Cut anew where the plane is another one, or there are other shapes."""
        self._reach(state.section)
        if state.section != self._shown:
            self._shown = state.section
            self._window.shapes.show_section(state.section)
        for panel in visible_panels(state) if state.section is not None else ():
            result = self._controller.shown.get(panel)
            if result is not None:
                self.cut(result)

    def cut(self, result: SurfaceResult) -> None:
        """Cut one surface, if there is a plane."""
        section = self._controller.state.section
        if section is not None:
            self._window.shapes.show_cut(result.request.panel, cut_of(result, section))

    def _commit(self, section: Section | None) -> None:
        self._before = None
        self._controller.commit(replace(self._controller.state, section=section))

    def _reach(self, section: Section | None) -> None:
        """Tell the bar between which offsets shapes can be cut."""
        box_mm = None if section is None else self._box_mm()
        if section is not None and box_mm is not None:
            low, high = _along(section.normal, box_mm)
            step = (high - low) * ROUND_TO
            unit = 10.0 ** np.floor(np.log10(step)) if step > 0 else 1.0
            ends = float(np.floor(low / unit) * unit), float(np.ceil(high / unit) * unit)
            self._window.show_reach(section, *ends)

    def _box_mm(self) -> NDArray[np.float64] | None:
        """Bounds of what is on screen, ``[3, 2]``; None where there is nothing."""
        shown = self._controller.shown
        found = [shown[panel] for panel in visible_panels(self._controller.state) if panel in shown]
        clouds = [each.points_mm for each in found if len(each.points_mm)]
        if not clouds:
            return None
        low = np.min([each.min(axis=0) for each in clouds], axis=0)
        return np.stack([low, np.max([each.max(axis=0) for each in clouds], axis=0)], axis=1).astype(float)


def _along(normal: Triple, box_mm: NDArray[np.float64]) -> tuple[float, float]:
    """How far a box ``[3, 2]`` reaches along a direction, from and to (mm)."""
    ends = box_mm * np.asarray(normal)[:, None]
    return float(ends.min(axis=1).sum()), float(ends.max(axis=1).sum())
