"""The matrix: what is clicked in it becomes the present covariates."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtCore import QObject

from naisr_viewer.control.controller import Controller
from naisr_viewer.state.explorer import at_cell
from naisr_viewer.state.layouts import Layout, Panel
from naisr_viewer.state.matrix import Matrix
from naisr_viewer.views.main_window import MainWindow


class MatrixDesk(QObject):
    """Wires the cells of the matrix and the boxes above them.

    Args:
        window: shows the matrix.
        controller: holds the state; it owns this.
    """

    def __init__(self, window: MainWindow, controller: Controller) -> None:
        super().__init__(controller)
        self._controller = controller
        window.shapes.chosen.connect(self.take)
        window.shapes.opened.connect(self.open)
        window.matrix_requested.connect(self.lay_out)

    def take(self, panel: Panel) -> None:
        """Go to the covariates of a cell, which is one step to undo; other panels have none of their own."""
        if panel.cell is not None and not self._controller.refinement.is_occupied:
            self._controller.commit(at_cell(self._controller.state, panel.cell))

    def open(self, panel: Panel) -> None:
        """Show the full shape at the covariates of a cell."""
        if panel.cell is not None:
            self.take(panel)
            self._controller.set_layout(Layout.FULL_SHAPE)

    def lay_out(self, matrix: Matrix) -> None:
        """Lay the shapes out by other covariates, or at other values of them."""
        self._controller.go(replace(self._controller.state, matrix=matrix))
