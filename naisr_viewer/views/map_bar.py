"""Above the shapes: what their surfaces are coloured by."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QToolButton, QWidget

from naisr_viewer.state.overlay import Overlay, Quantity
from naisr_viewer.views.elided import ElidedCheckBox, ElidedLabel
from naisr_viewer.words.maps import HINTS, SHARED, SHARED_HINT, TITLES
from naisr_viewer.words.numbers import in_unit
from naisr_viewer.words.titles import as_tip

LEAST_PX, SHARED_PX = 32, 110
FIRST = 100
"""How much more room one of two gets, until it has all that it needs."""


class MapBar(QFrame):
    """One choice of several, and whether all surfaces share a scale."""

    quantity_chosen = Signal(object)  # a Quantity
    shared_toggled = Signal(bool)  # whether all surfaces with numbers of one unit share its scale

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setObjectName("mapBar")
        self.buttons = {quantity: self._button(quantity) for quantity in Quantity}
        self._shown = Quantity.PLAIN
        self.shared = ElidedCheckBox(SHARED, SHARED_HINT, self)
        self.shared.setMaximumWidth(SHARED_PX)
        self.shared.toggled.connect(self.shared_toggled)
        self._told = ElidedLabel("", self)
        self._told.setObjectName("muted")
        row = QHBoxLayout(self)
        row.setContentsMargins(8, 4, 8, 4)
        row.setSpacing(0)
        for button in self.buttons.values():
            row.addWidget(button, 0, Qt.AlignmentFlag.AlignVCenter)
        row.addSpacing(8)
        row.addWidget(self._told, 1)
        row.addWidget(self.shared, FIRST)
        self.hide()

    @property
    def stops(self) -> list[QWidget]:
        """What the Tab key goes through, as it is read."""
        return [*self.buttons.values(), self.shared]

    def show_overlay(self, overlay: Overlay, told: str) -> None:
        """Show what was chosen.

        Args:
            overlay: the choice.
            told: what the numbers on the full shape are of.
        """
        self._shown = overlay.quantity
        for quantity, button in self.buttons.items():
            button.setChecked(quantity is overlay.quantity)
        with QSignalBlocker(self.shared):
            self.shared.setChecked(overlay.is_shared)
        self.shared.setVisible(overlay.quantity is not Quantity.PLAIN)
        self._told.setText(told)

    def show_unit(self, unit: str) -> None:
        """Name the choices after the atlas's unit of length."""
        for quantity, button in self.buttons.items():
            button.setText(in_unit(TITLES[quantity], unit))
            button.setToolTip(as_tip(in_unit(HINTS[quantity], unit)))

    def _button(self, quantity: Quantity) -> QToolButton:
        button = QToolButton(self)
        button.setText(TITLES[quantity])
        button.setToolTip(as_tip(HINTS[quantity]))
        button.setCheckable(True)
        button.setMinimumWidth(LEAST_PX)  # in a very small window its words give way; they are told on hover
        button.clicked.connect(lambda: self._press(quantity))
        return button

    def _press(self, quantity: Quantity) -> None:
        """Ask for another quantity; how the buttons look is for the state to say."""
        self.buttons[quantity].setChecked(quantity is self._shown)
        self.quantity_chosen.emit(quantity)
