"""What the parts of the right side are put together from."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from PySide6.QtCore import QPointF, QSignalBlocker, Qt
from PySide6.QtGui import QPainter, QPaintEvent, QPen, QStandardItemModel
from PySide6.QtWidgets import (
    QComboBox,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QStyle,
    QStyledItemDelegate,
    QVBoxLayout,
    QWidget,
)

from naisr_viewer.words.patients import sentence
from naisr_viewer.words.titles import as_tip

SIGN_PX = 16


def paragraph(
    text: str = "", style: str = "", side: Qt.AlignmentFlag = Qt.AlignmentFlag.AlignVCenter
) -> QLabel:
    """Words over several lines; what comes from files is never taken for markup."""
    words = QLabel(text)
    words.setTextFormat(Qt.TextFormat.PlainText)
    words.setWordWrap(True)
    words.setAlignment(side)
    words.setObjectName(style)
    return words


def button(text: str, tip: str, style: str = "") -> QPushButton:
    """A button that says on hover what it does."""
    result = QPushButton(text)
    result.setToolTip(tip)
    result.setObjectName(style)
    return result


def restyle(button: QPushButton, style: str) -> None:
    """Give a button another style."""
    if button.objectName() != style:
        button.setObjectName(style)
        button.style().unpolish(button)
        button.style().polish(button)


def section(part: QWidget, title: str, *beside: QWidget) -> QVBoxLayout:
    """The column of a part, beginning with its title and what stands ``beside`` it."""
    heading = QLabel(title)
    heading.setObjectName("section")
    head = QHBoxLayout()
    head.addWidget(heading, 1)
    for widget in beside:
        head.addWidget(widget)
    column = QVBoxLayout(part)
    column.setContentsMargins(0, 0, 0, 0)
    column.setSpacing(8)
    column.addLayout(head)
    return column


def grid_in(widget: QWidget, across: int, down: int, wide: int) -> QGridLayout:
    """A grid without margins, with room between its cells (px) and one ``wide`` column."""
    grid = QGridLayout(widget)
    grid.setContentsMargins(0, 0, 0, 0)
    grid.setHorizontalSpacing(across)
    grid.setVerticalSpacing(down)
    grid.setColumnStretch(wide, 1)
    return grid


def exchange(old: QWidget, new: QWidget) -> QWidget:
    """``new``, put where ``old`` was."""
    parent = old.parentWidget()
    assert parent is not None
    layout = parent.layout()
    assert layout is not None
    layout.replaceWidget(old, new)
    old.hide()
    old.deleteLater()
    new.show()  # else it has no size until the next event
    return new


def warnings(lines: Sequence[str]) -> QWidget:
    """Sentences below one another, each with a warning sign."""
    box = QWidget()
    grid = grid_in(box, 8, 6, wide=1)
    icon = box.style().standardIcon(QStyle.StandardPixmap.SP_MessageBoxWarning)
    for row, line in enumerate(lines):
        sign = QLabel()
        sign.setPixmap(icon.pixmap(SIGN_PX))
        grid.addWidget(sign, row, 0, Qt.AlignmentFlag.AlignTop)
        grid.addWidget(paragraph(sentence(line)), row, 1)
    return box


class ChoiceBox(QComboBox):
    """A combo box that is never wider than the panel."""

    def __init__(self, name: str, tip: str, parent: QWidget) -> None:
        super().__init__(parent)
        self.setAccessibleName(name)
        self._tip, self._reason = tip, ""
        self.setToolTip(tip)
        self.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self.setMinimumContentsLength(8)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setItemDelegate(QStyledItemDelegate(self))  # the usual one hardly marks the entry

    def refuse(self, reason: str) -> None:
        """Let nothing be chosen for a reason, which is told on hover; where there is none, let it."""
        self._reason = reason
        self.setEnabled(not reason)
        self.setToolTip(reason or self._tip)

    def show_choices(
        self,
        choices: Iterable[tuple[object, str]],
        current: object,
        barred: Mapping[Any, str] | None = None,
    ) -> None:
        """Show data and text of what there is and what is chosen, without telling anybody.

        Args:
            choices: data and text of each.
            current: data of the one that is chosen.
            barred: data of those that cannot be chosen, and why.
        """
        wanted = list(choices)
        with QSignalBlocker(self):
            if wanted != [(self.itemData(i), self.itemText(i)) for i in range(self.count())]:
                self.clear()
                for data, text in wanted:
                    self.addItem(text, data)
            for index, (data, text) in enumerate(wanted):
                self._bar(index, text, (barred or {}).get(data, ""))
            self.setCurrentIndex([data for data, _ in wanted].index(current))
        self.setToolTip(as_tip(self._reason or f"{self._tip}:\n{self.currentText()}"))

    def _bar(self, index: int, text: str, reason: str) -> None:
        """Let an entry be chosen unless there is a reason against it, which is told on hover."""
        model = self.model()
        assert isinstance(model, QStandardItemModel)
        model.item(index).setEnabled(not reason)
        self.setItemData(index, as_tip(sentence(reason) or text), Qt.ItemDataRole.ToolTipRole)

    def paintEvent(self, event: QPaintEvent) -> None:
        """The style sheet takes the arrow away with the frame; draw another."""
        super().paintEvent(event)
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(QPen(self.palette().text().color(), 1.5))
        x, y = self.width() - 14.0, self.height() / 2
        painter.drawPolyline([QPointF(x - 4, y - 2), QPointF(x, y + 2), QPointF(x + 4, y - 2)])
        painter.end()
