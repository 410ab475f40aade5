"""The centre of the window: the shapes, or before the first atlas an invitation, and errors above."""

from __future__ import annotations

from PySide6.QtWidgets import QStackedWidget, QVBoxLayout, QWidget

from naisr_viewer.views.changed_bar import ChangedBar
from naisr_viewer.views.empty_page import EmptyPage
from naisr_viewer.views.error_bar import ErrorBar


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
        self._pages = QStackedWidget(self)
        self._pages.addWidget(self.empty)
        self._pages.addWidget(shapes)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(self.errors)
        column.addWidget(self.changed)
        column.addWidget(self._pages, 1)

    def show_shapes(self, is_open: bool) -> None:
        """Show the shapes where an atlas is open, else the empty page."""
        self._pages.setCurrentIndex(1 if is_open else 0)
