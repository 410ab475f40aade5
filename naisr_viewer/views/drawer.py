"""Beneath the shapes: pages of which one is open, or none."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QFrame,
    QHBoxLayout,
    QSizePolicy,
    QStackedWidget,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from naisr_viewer.state.drawer import Tab

PAGE_PX = 144
"""Height of an open page; with the tabs above it the drawer takes some 170."""

LEAST_TAB_PX = 36
"""Of a narrow window's."""


class Drawer(QFrame):
    """A row of tabs, and the page whose tab is chosen.

    Args:
        pages: what each tab opens.
        parent: the widget around it.
    """

    tab_requested = Signal(object)  # the Tab that was pressed, or None: the open one was, or the cross

    def __init__(self, pages: Mapping[Tab, QWidget], parent: QWidget) -> None:
        super().__init__(parent)
        self.setObjectName("drawer")
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self._pages = pages
        self._open: Tab | None = None
        self.tabs = {tab: self._button(tab) for tab in pages}
        self.cross = QToolButton(self)
        self.cross.setText("×")
        self.cross.setAutoRaise(True)
        self.cross.setAccessibleName("Close")
        self.cross.setToolTip("Close what is below the shapes")
        self.cross.clicked.connect(lambda: self.tab_requested.emit(None))
        self._stack = QStackedWidget(self)
        self._stack.setFixedHeight(PAGE_PX)
        self._stack.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)  # no page widens it
        for page in pages.values():
            self._stack.addWidget(page)
        self._compose()
        self.offer(())
        self.show_tab(None)

    @property
    def stops(self) -> list[QWidget]:
        """What the Tab key goes through ahead of the pages, as it is read."""
        return [*self.tabs.values(), self.cross]

    def offer(self, tabs: Collection[Tab]) -> None:
        """Show these tabs and no others; the drawer is gone where there are none."""
        for tab, button in self.tabs.items():
            button.setVisible(tab in tabs)
        self.setVisible(bool(tabs))

    def show_tab(self, tab: Tab | None) -> None:
        """Open a page; None closes the one that is open."""
        self._open = tab
        for each, button in self.tabs.items():
            button.setChecked(each is tab)
        if tab is not None:
            self._stack.setCurrentWidget(self._pages[tab])
        self._stack.setVisible(tab is not None)
        self.cross.setVisible(tab is not None)

    def _button(self, tab: Tab) -> QToolButton:
        button = QToolButton(self)
        button.setText(tab.capitalize())
        button.setCheckable(True)
        button.setMinimumWidth(LEAST_TAB_PX)
        button.clicked.connect(lambda: self._press(tab))
        return button

    def _press(self, tab: Tab) -> None:
        """Ask for a page; how the button looks is for the state to say."""
        self.tabs[tab].setChecked(tab is self._open)
        self.tab_requested.emit(None if tab is self._open else tab)

    def _compose(self) -> None:
        row = QHBoxLayout()
        row.setContentsMargins(8, 1, 4, 1)
        row.setSpacing(2)
        for button in self.tabs.values():
            row.addWidget(button, 0, Qt.AlignmentFlag.AlignVCenter)
        row.addStretch(1)
        row.addWidget(self.cross)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 1, 0, 0)
        column.setSpacing(0)
        column.addLayout(row)
        column.addWidget(self._stack)
