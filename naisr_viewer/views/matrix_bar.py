"""By which two covariates the matrix is laid out: two boxes above the shapes, and how many values of each."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, QSize, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QBoxLayout, QHBoxLayout, QLabel, QSizePolicy, QSpinBox, QWidget

from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.matrix import (
    LEAST_STEPS,
    MOST_COLUMNS,
    MOST_ROWS,
    Axis,
    Matrix,
    Side,
    with_count,
    with_covariate,
)
from naisr_viewer.views.patients.pieces import ChoiceBox
from naisr_viewer.words.titles import label

NAME_PX, LEAST_NAME_PX = 130, 40
"""Width of a name, and what is left of it in a small window."""


GAP_PX = 6


class SideBox(QWidget):
    """One side: which covariate, and at how many values.

    Args:
        axis: which side.
        title: what it is called; the letter after ``&`` brings the keyboard there.
        most: values that there can be.
        parent: the widget around it.
    """

    def __init__(self, axis: Axis, title: str, most: int, parent: QWidget) -> None:
        super().__init__(parent)
        self.axis = axis
        plain = title.replace("&", "")
        self.names = ChoiceBox(plain, f"What changes along the {plain.lower()}", self)
        self.names.setMinimumWidth(LEAST_NAME_PX)
        self.names.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        self.count = QSpinBox(self)
        self.count.setRange(LEAST_STEPS, most)
        self.count.setAccessibleName(f"Values along the {plain.lower()}")
        self.count.setToolTip("How many values of it; the first row and column are of one covariate alone")
        self.title = QLabel(title, self)
        self.title.setBuddy(self.names)
        beside = self.title.sizeHint().width() + self.count.sizeHint().width() + 2 * GAP_PX
        self.setMaximumWidth(beside + NAME_PX)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(GAP_PX)
        row.addWidget(self.title)
        row.addWidget(self.names, 1)
        row.addWidget(self.count)

    def show_side(self, side: Side, atlas: AtlasCard) -> None:
        """Show what the side is, telling nobody."""
        choices = [(covariate.name, label(covariate.name)) for covariate in atlas.covariates]
        self.names.show_choices(choices, side.covariate)
        with QSignalBlocker(self.count):
            self.count.setValue(len(side.values))
        self.count.setEnabled(atlas.covariates[atlas.index(side.covariate)].kind == "continuous")


class MatrixBar(QWidget):
    """Both sides of the matrix.

    Args:
        parent: the widget around it.
    """

    changed = Signal(object)  # a Matrix that was chosen with the boxes

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setObjectName("matrixBar")
        self.across = SideBox("across", "&Columns", MOST_COLUMNS, self)
        self.down = SideBox("down", "&Rows", MOST_ROWS, self)
        self._atlas: AtlasCard | None = None
        self._matrix: Matrix | None = None
        self._row = QHBoxLayout(self)
        self._row.setContentsMargins(10, 4, 10, 4)
        self._row.setSpacing(3 * GAP_PX)
        for box in (self.across, self.down):
            self._row.addWidget(box, 1)
            box.names.activated.connect(lambda _, box=box: self._choose(box))
            box.count.valueChanged.connect(lambda count, box=box: self._count(box, count))
        self._row.addStretch(0)
        self.hide()

    @property
    def stops(self) -> list[QWidget]:
        """What the Tab key goes through."""
        return [self.across.names, self.across.count, self.down.names, self.down.count]

    def minimumSizeHint(self) -> QSize:
        """The window is not kept wide for it."""
        return QSize(0, super().minimumSizeHint().height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Where there is little room, one side under the other, and then without their titles."""
        super().resizeEvent(event)
        is_wide = self.width() >= 2 * self.across.sizeHint().width()
        direction = QBoxLayout.Direction.LeftToRight if is_wide else QBoxLayout.Direction.TopToBottom
        self._row.setDirection(direction)
        for box in (self.across, self.down):
            box.title.setVisible(self.width() >= self.across.maximumWidth())

    def show_matrix(self, matrix: Matrix | None, atlas: AtlasCard | None) -> None:
        """Show what the matrix is laid out by; None hides all of it."""
        self._matrix, self._atlas = matrix, atlas
        if matrix is not None and atlas is not None:
            self.across.show_side(matrix.across, atlas)
            self.down.show_side(matrix.down, atlas)
        self.setVisible(matrix is not None)

    def _choose(self, box: SideBox) -> None:
        if self._matrix is not None and self._atlas is not None:
            name = box.names.currentData()
            self.changed.emit(with_covariate(self._atlas, self._matrix, box.axis, name))

    def _count(self, box: SideBox, count: int) -> None:
        if self._matrix is not None and self._atlas is not None:
            self.changed.emit(with_count(self._atlas, self._matrix, box.axis, count))
