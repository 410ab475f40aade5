"""What all charts have in common: two axes in the colours of the window, and nothing that moves by itself.

pyqtgraph takes a tenth of a second to import: whoever shows a chart imports its module when there is time.
"""

from __future__ import annotations

import pyqtgraph
from PySide6.QtGui import QWheelEvent
from PySide6.QtWidgets import QWidget

from naisr_viewer.views.theme import Theme

SIDES = ("left", "bottom")
TICK_PX = 4
NUMBER_PX = 24
"""Room for the numbers of an axis; longer ones take more."""

MARGINS_PX = (4, 2, 6, 2)

pyqtgraph.setConfigOption("exitCleanup", False)  # a window frees its charts itself, at its own time


class Chart(pyqtgraph.PlotWidget):
    """Two axes; what is drawn between them, and what the mouse does there, is the charts' own.

    Args:
        parent: the widget around it.
    """

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent, background=None, enableMenu=False)
        self.setObjectName("chart")
        self.setAntialiasing(True)
        self.plotItem.hideButtons()
        self.plotItem.setContentsMargins(*MARGINS_PX)
        menu = self.plotItem.ctrlMenu
        menu.setParent(self, menu.windowFlags())  # it is never shown, and would outlive the chart
        self.plotItem.setMouseEnabled(False, False)
        for side in SIDES:
            axis = self.plotItem.getAxis(side)
            axis.setStyle(tickLength=-TICK_PX, hideOverlappingLabels=True, tickTextWidth=NUMBER_PX)
            axis.setStyle(autoReduceTextSpace=False)  # else the axes move under a hand that drags
            axis.enableAutoSIPrefix(False)

    def set_theme(self, theme: Theme) -> None:
        """Colour ground and axes."""
        self.setBackground(theme.raised)
        for side in SIDES:
            axis = self.plotItem.getAxis(side)
            axis.setPen(theme.line)
            axis.setTextPen(theme.muted)
            axis.setTickFont(self.font())

    def wheelEvent(self, event: QWheelEvent) -> None:
        """The wheel belongs to what scrolls."""
        event.ignore()
