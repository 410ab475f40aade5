"""All that stands around the shapes: the cells of an atlas and the lines between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from PySide6.QtCore import QRect
from PySide6.QtWidgets import QFrame, QWidget

from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.layouts import Panel
from naisr_viewer.views.shapes.arrangement import separators
from naisr_viewer.views.shapes.cell import Cell, make_cell


class Grid:
    """One cell per panel of an atlas, and lines between those that are on screen.

    Args:
        parent: the widget they stand on.

    Attributes:
        cells: by panel, in the order of the canvas's sub-plots.
    """

    def __init__(self, parent: QWidget) -> None:
        self._parent = parent
        self._lines: list[QFrame] = []
        self._areas: Mapping[Panel, QRect] = {}
        self._strip = 0
        self.cells: dict[Panel, Cell] = {}

    def fill(self, panels: Sequence[Panel], atlas: AtlasCard) -> None:
        """Make the cells of ``atlas``, still without places."""
        self.clear()
        self.cells = {panel: make_cell(panel, atlas, self._parent) for panel in panels}

    def clear(self) -> None:
        """Take everything away."""
        for cell in self.cells.values():
            cell.discard()
        for line in self._lines:
            line.deleteLater()
        self.cells, self._lines, self._areas = {}, [], {}

    def index(self, panel: Panel) -> int:
        """Which of the canvas's sub-plots a panel has."""
        return list(self.cells).index(panel)

    def say(self, panel: Panel, text: str, hint: str) -> None:
        """The line beneath a sub-plot, and more about it on hover."""
        cell = self.cells[panel]
        cell.caption.setText(text)
        cell.caption.setToolTip(hint)
        if panel in self._areas:
            cell.place(self._areas[panel], self._strip)

    def place(self, areas: Mapping[Panel, QRect], strip: int) -> None:
        """Show the cells that have an area and hide the others.

        Args:
            areas: where the panels on screen are (px), words included.
            strip: pixels beneath every shape for colour bars.
        """
        self._areas, self._strip = areas, strip
        for panel, cell in self.cells.items():
            if panel in areas:
                cell.place(areas[panel], strip)
            cell.show(panel in areas)
        self._place_lines(list(areas.values()))

    def show(self) -> None:
        """Show what the cells that have an area have now."""
        for panel, cell in self.cells.items():
            cell.show(panel in self._areas)

    def _place_lines(self, areas: Sequence[QRect]) -> None:
        for line in self._lines:
            line.hide()  # deleted later; it would be seen until then
            line.deleteLater()
        self._lines = []
        for edge in separators(areas):
            line = QFrame(self._parent)
            line.setObjectName("separator")
            line.setGeometry(*edge)
            line.show()
            self._lines.append(line)
