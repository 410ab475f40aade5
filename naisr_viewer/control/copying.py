"""What is shown, on the clipboard."""

from __future__ import annotations

from PySide6.QtCore import QObject
from PySide6.QtGui import QGuiApplication

from naisr_viewer.control.controller import Controller
from naisr_viewer.engine.sections import cut_of
from naisr_viewer.panels.kinds import title_of, visible_panels
from naisr_viewer.state.requests import SurfaceResult
from naisr_viewer.views.main_window import MainWindow
from naisr_viewer.words.table import table


class CopyDesk(QObject):
    """Wires what is copied.

    Args:
        window: shows what is copied.
        controller: holds the state; it owns this.
    """

    def __init__(self, window: MainWindow, controller: Controller) -> None:
        super().__init__(controller)
        self._window, self._controller = window, controller
        window.picture_copy_requested.connect(self.copy_picture)
        window.table_copy_requested.connect(self.copy_table)

    def copy_picture(self) -> None:
        """The shapes with their words, as large as they are on screen."""
        picture = self._window.shapes.grab().toImage()
        QGuiApplication.clipboard().setImage(picture)
        self._controller.refinement.tell(f"Copied a picture of {picture.width()}×{picture.height()} pixels")

    def copy_table(self) -> None:
        """Covariates, volume and cut of every view on screen."""
        state, shown = self._controller.state, self._controller.shown
        found = [shown[panel] for panel in visible_panels(state) if panel in shown]
        rows = [(title_of(each.request.panel), each, self._cut_mm2(each)) for each in found]
        QGuiApplication.clipboard().setText(table(state, rows))
        self._controller.refinement.tell(f"Copied a table of {len(rows)} rows")

    def _cut_mm2(self, result: SurfaceResult) -> float | None:
        section = self._controller.state.section
        return None if section is None else cut_of(result, section).area_mm2
