"""The matrix: what is clicked in it becomes the present covariates."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtCore import QObject

from naisr_viewer.control import jobs
from naisr_viewer.control.controller import Controller
from naisr_viewer.engine.engine import Engine
from naisr_viewer.files.matrix import planned_matrix
from naisr_viewer.state.explorer import at_cell
from naisr_viewer.state.layouts import Layout, Panel
from naisr_viewer.state.matrix import Matrix
from naisr_viewer.state.requests import ExportChoice
from naisr_viewer.views.colours import printed_colours
from naisr_viewer.views.main_window import MainWindow


class MatrixDesk(QObject):
    """Wires the cells of the matrix and the boxes above them.

    Args:
        window: shows the matrix.
        controller: holds the state; it owns this.
        engine: computes what is exported.
    """

    def __init__(self, window: MainWindow, controller: Controller, engine: Engine) -> None:
        super().__init__(controller)
        self._controller, self._engine = controller, engine
        window.shapes.chosen.connect(self.take)
        window.shapes.opened.connect(self.open)
        window.matrix_requested.connect(self.lay_out)
        window.figure_requested.connect(self.export)

    def take(self, panel: Panel) -> None:
        """Go to the covariates of a cell, which is one step to undo; other panels have none of their own."""
        if panel.cell is not None and not self._controller.refinement.is_occupied:
            self._controller.commit(at_cell(self._controller.state, panel.cell))

    def open(self, panel: Panel) -> None:
        """Show the full shape at the covariates of a cell."""
        if panel.cell is not None:
            self.take(panel)
            self._controller.set_layout(Layout.FULL_SHAPE)

    def export(self, choice: ExportChoice, replaces: bool = False) -> None:
        """Write the matrix on screen: a figure, the meshes and a record; what is missing is computed first.

        Args:
            choice: what to write and where.
            replaces: whether files that are there already are replaced without a question.
        """
        state, refinement = self._controller.state, self._controller.refinement
        plan = planned_matrix(state, choice)
        if replaces or self._controller.questions.may_replace(plan.in_the_way):
            job = jobs.exporting_matrix(self._engine, state, plan, choice, printed_colours(state))
            told = f"Exporting into {choice.folder} …"
            refinement.run(told, job, lambda report: refinement.tell(report.sentence))

    def lay_out(self, matrix: Matrix) -> None:
        """Lay the shapes out by other covariates, or at other values of them."""
        self._controller.go(replace(self._controller.state, matrix=matrix))
