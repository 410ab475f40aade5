"""The parts of the right side: scan, alignment, known covariates, result and comparison."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QPointF, QSignalBlocker, Qt, Signal
from PySide6.QtGui import QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QFormLayout,
    QFrame,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QStyle,
    QStyledItemDelegate,
    QVBoxLayout,
    QWidget,
)

from naisr_model.covariates import Covariate
from naisr_viewer.patients import Fitted, Method, Named, Patient, Reading
from naisr_viewer.state import ExplorerState, label
from naisr_viewer.views.covariate_panel import LevelButton, ValueBox
from naisr_viewer.views.dialogs import ask_landmarks_path
from naisr_viewer.views.patient_words import METHODS, breakable, findings, measured, sentence, units

SIGN_PX = 16

REREAD_TIP = "Read the file from the disk again, for example after it was edited"
SEE_FIRST = "The scan is drawn over the atlas as it lies; see that it fits before it is fitted."
FIT_TIP = "Find the shape of the atlas that comes closest to the scan"


# --- pieces -------------------------------------------------------------------------------------


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
        self.setToolTip(tip)
        self.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self.setMinimumContentsLength(8)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setItemDelegate(QStyledItemDelegate(self))  # the usual one hardly marks the entry

    def show_choices(self, choices: Iterable[tuple[object, str]], current: object) -> None:
        """Show data and text of what there is and what is chosen, without telling anybody."""
        wanted = list(choices)
        with QSignalBlocker(self):
            if wanted != [(self.itemData(i), self.itemText(i)) for i in range(self.count())]:
                self.clear()
                for data, text in wanted:
                    self.addItem(text, data)
            self.setCurrentIndex([data for data, _ in wanted].index(current))

    def paintEvent(self, event: QPaintEvent) -> None:
        """The style sheet takes the arrow away with the frame; draw another."""
        super().paintEvent(event)
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(QPen(self.palette().text().color(), 1.5))
        x, y = self.width() - 14.0, self.height() / 2
        painter.drawPolyline([QPointF(x - 4, y - 2), QPointF(x, y + 2), QPointF(x + 4, y - 2)])
        painter.end()


# --- the scan and where it lies -----------------------------------------------------------------


class ScanPart(QWidget):
    """What was measured, and what is the matter with it."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.reread = button("Read again", REREAD_TIP, "small")
        self.reread_changed = button("Read again", REREAD_TIP)
        self.changed = QFrame()
        self.changed.setObjectName("changed")
        self.source = paragraph()
        self.volume = paragraph(style="muted")
        self.blocked = paragraph(style="blocked")
        self.notes = QWidget()
        self._notes_shown: tuple[str, ...] = ()
        self.ghost = QCheckBox("Show the scan over the shape")
        self.ghost.setToolTip("Draw what was measured, transparent, over the atlas's shape")
        self._compose()

    def show_patient(self, patient: Patient, has_ghost: bool) -> None:
        """Show ``patient``'s scan."""
        scan = patient.scan
        self.source.setText(breakable(scan.source))
        self.source.setToolTip(str(patient.reading.path))
        self.volume.setText(measured(scan))
        if scan.notes != self._notes_shown:
            self._notes_shown = scan.notes
            self.notes = exchange(self.notes, warnings(scan.notes))
        self.notes.setVisible(bool(scan.notes))
        self.blocked.setText(sentence(scan.blocked))
        self.blocked.setVisible(bool(scan.blocked))
        self.changed.setVisible(patient.is_changed)
        self.reread.setVisible(not patient.is_changed)
        self.ghost.setChecked(has_ghost)

    def _compose(self) -> None:
        notice = QHBoxLayout(self.changed)
        notice.setContentsMargins(10, 8, 8, 8)
        notice.addWidget(paragraph("The file has changed on disk"), 1)
        notice.addWidget(self.reread_changed)
        facts = QVBoxLayout()
        facts.setSpacing(2)
        facts.addWidget(self.source)
        facts.addWidget(self.volume)
        column = section(self, "Scan", self.reread)
        column.addWidget(self.changed)
        column.addLayout(facts)
        for widget in (self.blocked, self.notes, self.ghost):
            column.addWidget(widget)


class AlignmentPart(QWidget):
    """How the file is brought into the frame of the atlas."""

    reading_changed = Signal(object)  # a Reading with another alignment or unit

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self._reading = Reading(Path())
        self.method = ChoiceBox("Alignment", "How the scan is moved onto the atlas's shape", self)
        self.unit = ChoiceBox("Unit of the file", "How long one unit of the file's coordinates is", self)
        self.sentence = paragraph()
        self.hint = paragraph(SEE_FIRST, "muted")
        form = QFormLayout()
        form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        form.setHorizontalSpacing(12)
        form.setVerticalSpacing(6)
        form.addRow("Position", self.method)
        form.addRow("Unit", self.unit)
        column = section(self, "Alignment")
        column.addLayout(form)
        column.addWidget(self.sentence)
        column.addWidget(self.hint)
        self.method.activated.connect(self._method_chosen)
        self.unit.activated.connect(self._unit_chosen)

    def show_patient(self, patient: Patient, has_ghost: bool) -> None:
        """Show how ``patient``'s file was read, and that it can be seen where the scan lies."""
        self._reading = patient.reading
        self.method.show_choices(METHODS, patient.reading.align)
        self.unit.show_choices(units(patient.reading.scale), patient.reading.scale)
        self.sentence.setText(sentence(patient.scan.alignment))
        self.sentence.setVisible(bool(patient.scan.alignment))
        self.hint.setVisible(has_ghost and patient.fit is None and not patient.scan.blocked)

    def _method_chosen(self) -> None:
        align: Method = self.method.currentData()
        landmarks = ask_landmarks_path(self) if align == "landmarks" else None
        if align == "landmarks" and landmarks is None:
            self.method.show_choices(METHODS, self._reading.align)
        else:
            self._ask(replace(self._reading, align=align, landmarks=landmarks))

    def _unit_chosen(self) -> None:
        self._ask(replace(self._reading, scale=self.unit.currentData()))

    def _ask(self, reading: Reading) -> None:
        if reading != self._reading:
            self.reading_changed.emit(reading)


# --- what is known ------------------------------------------------------------------------------


FAR = 1e6
"""Beyond any value of a covariate."""


class NumberField(ValueBox):
    """The value of a continuous covariate; empty while it is to be inferred."""

    edited = Signal()  # the user gave a value or took it away

    is_given = False

    def __init__(self, covariate: Covariate, parent: QWidget) -> None:
        super().__init__(covariate, parent)
        self.covariate = covariate
        self.stops: list[QWidget] = [self]
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setRange(-FAR, FAR)  # what is out of range is told, not turned into something else
        self.lineEdit().setPlaceholderText("infer")
        self.lineEdit().textEdited.connect(self._typed)

    def given(self) -> float | None:
        """What was typed, or None; an end of the observed range that the box had to round is that end."""
        self.interpretText()
        value, step = self.value(), 10.0 ** -self.decimals()
        ends = (end for end in self.covariate.range if abs(value - end) < step)
        return next(ends, value) if self.is_given else None

    def give(self, value: float | None) -> None:
        """Show a value, or that there is none."""
        self.is_given = value is not None
        with QSignalBlocker(self):
            self.setValue(self.covariate.centre if value is None else value)

    def ask(self) -> None:
        """Propose the population mean, to be typed over."""
        self.give(self.covariate.centre)
        self.setFocus()
        self.selectAll()

    def textFromValue(self, value: float) -> str:
        """Nothing for no value."""
        return super().textFromValue(value) if self.is_given else ""

    def stepBy(self, steps: int) -> None:
        """Arrow keys and the wheel begin at the population mean."""
        self.is_given = True
        super().stepBy(steps)
        self.edited.emit()

    def _typed(self, text: str) -> None:
        self.is_given = bool(text.strip())
        self.edited.emit()


class LevelField(QWidget):
    """The level of a binary covariate; none while it is to be inferred."""

    edited = Signal()  # the user chose a level

    def __init__(self, covariate: Covariate, parent: QWidget) -> None:
        super().__init__(parent)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(4)
        levels = zip(covariate.levels, (-1.0, 1.0), strict=True)
        self.buttons = [LevelButton(name, value, self) for name, value in levels]
        self.stops: list[QWidget] = [*self.buttons]
        for each in self.buttons:
            each.setAccessibleName(f"{label(covariate.name)}: {each.text()}")
            each.clicked.connect(self._pressed)
            row.addWidget(each, 1)

    @property
    def is_given(self) -> bool:
        """Whether a level is chosen."""
        return self.given() is not None

    def given(self) -> float | None:
        """The value of the chosen level, or None."""
        return next((each.level for each in self.buttons if each.isChecked()), None)

    def give(self, value: float | None) -> None:
        """Show a level, or that there is none."""
        for each in self.buttons:
            each.setChecked(each.level == value)

    def ask(self) -> None:
        """Propose the first level."""
        self.give(self.buttons[0].level)
        self.buttons[0].setFocus()

    def _pressed(self) -> None:
        pressed = self.sender()
        assert isinstance(pressed, LevelButton)
        self.give(pressed.level)
        self.edited.emit()


class KnownRow:
    """One covariate: ticked with its value, or to be inferred."""

    def __init__(self, covariate: Covariate, parent: QWidget) -> None:
        name = label(covariate.name)
        self.covariate = covariate
        self.check = QCheckBox(name, parent)
        self.check.setAccessibleName(f"{name} is known")
        self.check.setToolTip(f"Tick where {name.lower()} is known; otherwise the fit infers it")
        make = NumberField if covariate.kind == "continuous" else LevelField
        self.field: NumberField | LevelField = make(covariate, parent)
        self.note = QLabel(parent)
        self.note.setObjectName("muted")
        self.give(None)
        self.check.clicked.connect(self._ticked)
        self.field.edited.connect(self._mark)

    def give(self, value: float | None) -> None:
        """Show a known value, or that there is none."""
        self.field.give(value)
        self._mark()

    def _ticked(self, is_known: bool) -> None:
        if is_known:
            self.field.ask()
        else:
            self.field.give(None)
        self._mark()

    def _mark(self) -> None:
        self.check.setChecked(self.field.is_given)
        self.note.setText(self.covariate.unit or ("" if self.field.is_given else "infer"))


class KnownPart(QWidget):
    """The covariates that are known, and the button that fits."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.rows: dict[str, KnownRow] = {}
        self.fit = button("Fit", FIT_TIP, "primary")
        self._table = QWidget()
        column = section(self, "Known covariates")
        column.addWidget(paragraph("Tick what is known; the rest is inferred from the shape.", "muted"))
        column.addWidget(self._table)
        column.addSpacing(4)
        column.addWidget(self.fit)

    def show_covariates(self, covariates: Sequence[Covariate]) -> None:
        """Make the rows of an atlas."""
        table = QWidget()
        grid = grid_in(table, 8, 6, wide=0)
        self.rows = {each.name: KnownRow(each, table) for each in covariates}
        for line, row in enumerate(self.rows.values()):
            for column, widget in enumerate((row.check, row.field, row.note)):
                grid.addWidget(widget, line, column)
        self._table = exchange(self._table, table)

    def show_patient(self, patient: Patient) -> None:
        """Show whether ``patient`` can be fitted; what is typed stays."""
        self.fit.setText("Fit again" if patient.fit else "Fit")
        self.fit.setEnabled(not patient.scan.blocked)
        self.fit.setToolTip(patient.scan.blocked or FIT_TIP)

    def given(self) -> Named:
        """What is known, in the atlas's order."""
        values = ((name, row.field.given()) for name, row in self.rows.items())
        return tuple((name, value) for name, value in values if value is not None)

    def give(self, known: Named) -> None:
        """Show what is known, and of all others that they are not."""
        values = dict(known)
        for name, row in self.rows.items():
            row.give(values.get(name))

    def stops(self) -> list[QWidget]:
        """What the Tab key goes through, in order."""
        rows = self.rows.values()
        return [*(stop for row in rows for stop in (row.check, *row.field.stops)), self.fit]


# --- what was found -----------------------------------------------------------------------------


def result_part(fit: Fitted, covariates: Sequence[Covariate]) -> QWidget:
    """What ``fit`` found, and how sure it is."""
    part, table = QWidget(), QWidget()
    column = section(part, "Result")
    column.addWidget(table)
    if fit.remarks:
        column.addWidget(warnings(fit.remarks))
    grid = grid_in(table, 12, 0, wide=1)
    top, right = Qt.AlignmentFlag.AlignTop, Qt.AlignmentFlag.AlignTop | Qt.AlignmentFlag.AlignRight
    for row, (what, value, sure) in enumerate(findings(fit, covariates)):
        figure = paragraph(value, "figure", right)
        figure.setAccessibleName(f"{what}: {value}")
        grid.addWidget(paragraph(what, "muted", top), 3 * row, 0)
        grid.addWidget(figure, 3 * row, 1)
        if sure:
            grid.addWidget(paragraph(sure, "muted", right), 3 * row + 1, 0, 1, 2)
        grid.setRowMinimumHeight(3 * row + 2, 6)
    return part


class ComparePart(QWidget):
    """Which fit the change is counted from."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.box = ChoiceBox("Compare with", "What “before” is in View > Before and after", self)
        section(self, "Compare with").addWidget(self.box)

    def show_state(self, state: ExplorerState) -> None:
        """Offer the other fitted patients."""
        others = {each.key: each.name for each in state.patients if each.fit and each.key != state.patient}
        current = state.compared if state.compared in others else None
        self.box.show_choices([(None, "this patient as fitted"), *others.items()], current)
