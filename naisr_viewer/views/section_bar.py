"""Above the shapes: which plane cuts them, and where it is."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, QSize, Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QToolButton, QWidget

from naisr_viewer.state.section import Section
from naisr_viewer.views.covariates.slider import SLIDER_STEPS, JumpSlider
from naisr_viewer.views.elided import ElidedLabel
from naisr_viewer.views.patients.pieces import ChoiceBox
from naisr_viewer.views.theme import Theme
from naisr_viewer.words.section import FLIP_HINT, HINT, OFFSET_HINT, TITLES, place
from naisr_viewer.words.titles import as_tip

PLANE_PX, LEAST_PLANE_PX = 130, 40
FIRST = 100
"""How much more room the number gets than the slider, until it has all that it needs."""

WIDEST = "x\u00a0=\u00a0−888.8\u00a0mm"
LEAST_SLIDER_PX = 40
GAP_PX = 8


class SectionBar(QWidget):
    """The plane, a slider along its normal, and which side is shown."""

    plane_chosen = Signal(object)  # a Plane
    offset_moved = Signal(float)  # mm, while the slider is dragged
    offset_settled = Signal(float)  # mm, when it is let go or stepped by keys
    flip_requested = Signal()  # the other side shall be shown

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setObjectName("sectionBar")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self._reach_mm = (0.0, 1.0)
        self.planes = ChoiceBox("Plane", HINT, self)
        self.planes.setMinimumWidth(LEAST_PLANE_PX)
        self.planes.setMaximumWidth(PLANE_PX)
        self.planes.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        self.planes.activated.connect(lambda _: self.plane_chosen.emit(self.planes.currentData()))
        self.slider = JumpSlider(self)
        self.slider.setAccessibleName("Place of the section plane")
        self.slider.setToolTip(as_tip(OFFSET_HINT))
        self.slider.setMinimumWidth(LEAST_SLIDER_PX)
        self.slider.valueChanged.connect(self._moved)
        self.slider.sliderReleased.connect(lambda: self.offset_settled.emit(self._offset_mm))
        self._place = ElidedLabel("", self)
        self._place.setMaximumWidth(self._place.fontMetrics().horizontalAdvance(WIDEST) + GAP_PX)
        self.flip = QToolButton(self)
        self.flip.setText("Flip")
        self.flip.setToolTip(FLIP_HINT)
        self.flip.clicked.connect(self.flip_requested)
        row = QHBoxLayout(self)
        row.setContentsMargins(8, 4, 8, 4)
        row.setSpacing(GAP_PX)
        row.addWidget(self.planes, FIRST)
        row.addWidget(self.slider, 2)
        row.addWidget(self._place, FIRST)
        row.addWidget(self.flip)
        self.hide()

    @property
    def stops(self) -> list[QWidget]:
        """What the Tab key goes through, as it is read."""
        return [self.planes, self.slider, self.flip]

    def minimumSizeHint(self) -> QSize:
        """The window is not kept wide for it."""
        return QSize(0, super().minimumSizeHint().height())

    def show_section(self, section: Section | None) -> None:
        """Show where the plane is, telling nobody; None hides all of it."""
        if section is not None:
            self.planes.show_choices(TITLES.items(), section.plane)
            self._place.setText(place(section))
            low, high = self._reach_mm
            with QSignalBlocker(self.slider):
                share = (section.offset_mm - low) / (high - low)
                self.slider.setValue(round(min(max(share, 0.0), 1.0) * SLIDER_STEPS))
            self.slider.update()
        self.setVisible(section is not None)

    def show_reach(self, low_mm: float, high_mm: float) -> None:
        """Say between which offsets there is something to cut; a hand on the slider is left alone."""
        if not self.slider.isSliderDown():
            self._reach_mm = (low_mm, max(high_mm, low_mm + 1e-6))

    def set_theme(self, theme: Theme) -> None:
        """Follow the theme."""
        self.slider.set_colours(theme, theme.accent)

    @property
    def _offset_mm(self) -> float:
        low, high = self._reach_mm
        return round(low + (high - low) * self.slider.value() / SLIDER_STEPS, 1)

    def _moved(self, _position: int) -> None:
        is_held = self.slider.isSliderDown()
        (self.offset_moved if is_held else self.offset_settled).emit(self._offset_mm)
