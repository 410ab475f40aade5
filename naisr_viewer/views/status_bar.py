"""What goes on, at the bottom of the window."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeySequence
from PySide6.QtWidgets import QProgressBar, QPushButton, QStatusBar, QWidget

from naisr_viewer.views.elided import ElidedLabel
from naisr_viewer.views.shapes.scale_bar import ScaleBar

STEPS = 1000
"""Of the progress bar."""


class StatusBar(QStatusBar):
    """One line of text, how far the work is, and the scale of the shapes."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setSizeGripEnabled(False)
        self.setMinimumHeight(34)
        self.text = ElidedLabel("", self)
        self.text.keep_free(12, 0)
        self.progress = QProgressBar(self)
        self.progress.setRange(0, STEPS)
        self.progress.setTextVisible(False)
        self.progress.setFixedWidth(180)
        self.cancel = QPushButton("Cancel", self)
        self.cancel.setToolTip("Stop the computation and keep what is on screen (Esc)")
        self.cancel.setShortcut(QKeySequence(Qt.Key.Key_Escape))
        self.scale = ScaleBar(self)
        self.readout = ElidedLabel("", self)
        self.readout.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.readout.keep_free(0, 12)
        self.addWidget(self.text, 1)
        self.addWidget(self.readout, 1)
        for widget in (self.progress, self.cancel, self.scale):
            self.addPermanentWidget(widget)
        self.show_progress(None)
        self.show_readout("")

    def show_readout(self, text: str) -> None:
        """What is under the mouse; nothing leaves the room to the line of text."""
        self.readout.setText(text)
        self.readout.setVisible(bool(text))

    def show_progress(self, fraction: float | None) -> None:
        """The bar and its cancel button; None hides them, at 0 it only says: busy."""
        self.progress.setMaximum(STEPS if fraction else 0)
        self.progress.setVisible(fraction is not None)
        self.cancel.setVisible(fraction is not None)
        self.progress.setValue(round(STEPS * (fraction or 0.0)))
