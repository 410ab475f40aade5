"""The centre of the window: the shapes, or before the first atlas an invitation, and errors above."""

from __future__ import annotations

from PySide6.QtCore import QSize
from PySide6.QtWidgets import QSizePolicy, QVBoxLayout, QWidget

from naisr_viewer.state.drawer import Tab
from naisr_viewer.views.changed_bar import ChangedBar
from naisr_viewer.views.curve_page import CurvePage
from naisr_viewer.views.drawer import Drawer
from naisr_viewer.views.empty_page import EmptyPage
from naisr_viewer.views.error_bar import ErrorBar
from naisr_viewer.views.ledger import LedgerPage
from naisr_viewer.views.map_bar import MapBar
from naisr_viewer.views.matrix_bar import MatrixBar
from naisr_viewer.views.section_bar import SectionBar

FULL_WIDTH_PX = 540
"""A narrower window takes from the panels as well as from the shapes."""


class Centre(QWidget):
    """Shows the empty page or the shapes.

    Args:
        shapes: what draws them.
        parent: the widget around it.
    """

    def __init__(self, shapes: QWidget, parent: QWidget) -> None:
        super().__init__(parent)
        self.errors = ErrorBar(self)
        self.changed = ChangedBar(self)
        self.empty = EmptyPage(self)
        self.maps = MapBar(self)
        self.matrix = MatrixBar(self)
        self.section = SectionBar(self)
        self.ledger = LedgerPage(self)
        self.curve = CurvePage(self)
        self.drawer = Drawer({Tab.POINT: self.ledger, Tab.CURVE: self.curve}, self)
        self._shapes = shapes
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(self.errors)
        column.addWidget(self.changed)
        column.addWidget(self.empty, 1)
        column.addWidget(self.maps)
        column.addWidget(self.matrix)
        column.addWidget(self.section)
        column.addWidget(shapes, 1)
        column.addWidget(self.drawer)
        self.show_shapes(False)

    def sizeHint(self) -> QSize:
        """The width from which on the panels beside it have theirs."""
        return QSize(FULL_WIDTH_PX, super().sizeHint().height())

    @property
    def stops(self) -> list[QWidget]:
        """What the Tab key goes through, as it is read."""
        bars = [*self.maps.stops, *self.matrix.stops, *self.section.stops]
        return [*self.errors.stops, *self.changed.stops, self.empty.button, *bars]

    @property
    def drawer_stops(self) -> list[QWidget]:
        """The same below the shapes."""
        return [*self.drawer.stops, self.ledger, *self.curve.stops]

    def show_shapes(self, is_open: bool) -> None:
        """Show the shapes where an atlas is open, else the empty page."""
        self.empty.setVisible(not is_open)
        self._shapes.setVisible(is_open)
