"""What leads to the rows of sub-plots that a low window has no room for."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, Qt
from PySide6.QtWidgets import QScrollBar, QWidget

from naisr_viewer.views.shapes.arrangement import Rows


def row_scroll(parent: QWidget) -> QScrollBar:
    """A scroll bar that goes from row to row."""
    bar = QScrollBar(Qt.Orientation.Vertical, parent)
    bar.setAccessibleName("More views")
    bar.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
    bar.hide()
    return bar


def show_rows(bar: QScrollBar, rows: Rows) -> None:
    """Offer the rows that are out of sight, telling nobody."""
    with QSignalBlocker(bar):
        bar.setRange(0, rows.total - rows.in_sight)
        bar.setPageStep(rows.in_sight)
    bar.setVisible(bar.maximum() > 0)
