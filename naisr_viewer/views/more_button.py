"""The sign at the end of a toolbar that has more buttons than room."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QProxyStyle, QStyle, QStyleOption, QToolBar, QToolButton, QWidget

OF_QT = "qt_toolbar_ext_button"
"""The name under which Qt makes the button that opens the rest of a toolbar."""

WIDTH_PX = 30


class RoomForMore(QProxyStyle):
    """A style that gives the button more than a sliver."""

    def pixelMetric(
        self, metric: QStyle.PixelMetric, option: QStyleOption | None = None, widget: QWidget | None = None
    ) -> int:
        """That of the usual style but for the button."""
        if metric == QStyle.PixelMetric.PM_ToolBarExtensionExtent:
            return WIDTH_PX
        return super().pixelMetric(metric, option, widget)


def show_more_sign(bar: QToolBar) -> None:
    """Write on the button that opens the rest; Qt draws a speck that is black on dark grounds, too."""
    style = RoomForMore()
    style.setParent(bar)
    bar.setStyle(style)
    button = bar.findChild(QToolButton, OF_QT)
    assert button is not None
    button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextOnly)
    button.setText("»")
    button.setToolTip("More")
    button.setAccessibleName("More")
