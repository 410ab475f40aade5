"""Of a patient: the covariates that are known, typed or chosen, and the button that fits."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import QCheckBox, QHBoxLayout, QLabel, QWidget

from naisr_model.covariates import Covariate
from naisr_viewer.state.patients import Named, OpenScan
from naisr_viewer.views.patients.pieces import button, exchange, grid_in, paragraph, section
from naisr_viewer.views.value_inputs import LevelButton, ValueBox, level_buttons
from naisr_viewer.words.titles import label

FIT_TIP = "Find the shape of the atlas that comes closest to the scan"

ADVICE = "Tick what is known; the rest is inferred from the shape."
NOTHING_TO_KNOW = "The shapes of this atlas depend on no covariates; there is nothing to be known."

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
        self.buttons = level_buttons(covariate, self)
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
        self._advice = paragraph(ADVICE, "muted")
        column.addWidget(self._advice)
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
        self._advice.setText(ADVICE if covariates else NOTHING_TO_KNOW)
        self._table = exchange(self._table, table)

    def show_patient(self, patient: OpenScan) -> None:
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
