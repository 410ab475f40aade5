"""All that stands around the shapes: the cells of an atlas and the lines between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtWidgets import QFrame, QWidget

from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.layouts import Panel
from naisr_viewer.views.shapes.arrangement import Strips, separators
from naisr_viewer.views.shapes.cell import Cell, make_cell
from naisr_viewer.views.shapes.compass import ends


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
        self._strips = Strips()
        self.cells: dict[Panel, Cell] = {}
        self._outlined: Panel | None = None
        self._outline = QFrame(parent)
        self._outline.setObjectName("outline")
        self._outline.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self._outline.hide()

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

    def panel(self, index: int) -> Panel:
        """Whose sub-plot that is."""
        return list(self.cells)[index]

    def panel_at(self, place: QPoint) -> Panel | None:
        """Which sub-plot is on screen there, words included."""
        return next((panel for panel, area in self._areas.items() if area.contains(place)), None)

    def say(self, panel: Panel, text: str, hint: str) -> None:
        """The line beneath a sub-plot, and more about it on hover."""
        cell = self.cells[panel]
        cell.words = text
        cell.caption.setToolTip(hint)
        self.say_again(panel)

    def say_again(self, panel: Panel) -> None:
        """The same where there is more to say."""
        cell = self.cells[panel]
        cell.caption.setText(cell.told)
        if panel in self._areas:
            cell.place(self._areas[panel], self._strips)

    def place(self, areas: Mapping[Panel, QRect], strips: Strips) -> None:
        """Show the cells that have an area and hide the others.

        Args:
            areas: where the panels on screen are (px), words included.
            strips: what stands above and beneath every shape.
        """
        self._areas, self._strips = areas, strips
        for panel, cell in self.cells.items():
            if panel in areas:
                cell.place(areas[panel], strips)
            cell.show(panel in areas)
        self._place_lines(list(areas.values()))
        self.outline(self._outlined)

    def turn(self, right: Sequence[float], up: Sequence[float]) -> None:
        """Have all compasses follow the camera; directions in the picture, of length 1."""
        found = ends(right, up)
        for cell in self.cells.values():
            if cell.compass is not None:
                cell.compass.show_ends(found)

    def outline(self, panel: Panel | None) -> None:
        """Draw a line around a sub-plot, and around no other."""
        self._outlined = panel
        area = None if panel is None else self._areas.get(panel)
        if area is not None:
            self._outline.setGeometry(area)
            self._outline.raise_()
        self._outline.setVisible(area is not None)

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
