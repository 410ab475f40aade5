"""Of a patient: the covariates that are known, typed or chosen, and the button that fits."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QWidget

from naisr_model.covariates import Covariate
from naisr_viewer.state.patients import Named, OpenScan
from naisr_viewer.views.elided import ElidedCheckBox, unit_label
from naisr_viewer.views.level_buttons import LevelButton, level_buttons
from naisr_viewer.views.number_box import NumberBox
from naisr_viewer.views.patients.pieces import button, exchange, grid_in, paragraph, restyle, section
from naisr_viewer.words.patients import sentence
from naisr_viewer.words.titles import as_tip, label

FIT_TIP = "Find the shape of the atlas that comes closest to the scan"
ALIGN_TIP = "The scan does not lie as the shapes of the atlas do: choose its Position before it is fitted"

ADVICE = "Tick what is known; the rest is inferred from the scan."
NOTHING_TO_KNOW = "The shapes of this atlas depend on no covariates; there is nothing to be known."


class NumberField(NumberBox):
    """The value of a continuous covariate; empty while it is to be inferred."""

    edited = Signal()  # the user gave a value or took it away

    def __init__(self, covariate: Covariate, parent: QWidget) -> None:
        super().__init__(covariate, parent)
        self.stops: list[QWidget] = [self]
        self.setPlaceholderText("infer")
        self.textEdited.connect(lambda _: self.edited.emit())
        self.committed.connect(lambda _: self.edited.emit())

    @property
    def is_given(self) -> bool:
        """Whether anything stands there."""
        return self.value is not None

    def given(self) -> float | None:
        """What was typed, also outside the range; NaN for what is no number, None for nothing."""
        return self.value

    def give(self, value: float | None) -> None:
        """Show a value, or that there is none."""
        self.put(value)

    def ask(self) -> None:
        """Propose the population mean, to be typed over."""
        self.give(self.covariate.centre)
        self.setFocus()
        self.selectAll()

    def _restore(self) -> None:
        """As if nothing had been typed; whoever was told of the typing is told of that."""
        super()._restore()
        self.edited.emit()

    def _emptied(self) -> None:
        """Nothing means: to be inferred."""
        self.put(None)


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
            each.setAccessibleName(f"{label(covariate.name)}: {each.name}")
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
        self.check = ElidedCheckBox(name, "Tick what is known; the fit infers the rest", parent)
        self.check.setAccessibleName(f"{name} is known")
        make = NumberField if covariate.kind == "continuous" else LevelField
        self.field: NumberField | LevelField = make(covariate, parent)
        self.note = unit_label("", parent)
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
    """The covariates that are known, the button that fits, and one that says to align first."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.rows: dict[str, KnownRow] = {}
        self.fit = button("Fit", FIT_TIP, "primary")  # for the panel, which keeps it in sight
        self.align = button("Align it first", ALIGN_TIP)
        self._table = QWidget()
        column = section(self, "Known covariates")
        self._advice = paragraph(ADVICE, "muted")
        column.addWidget(self._advice)
        column.addWidget(self._table)

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
        self.align.setVisible(patient.scan.is_astray)
        restyle(self.align, "primary" if patient.scan.is_astray else "")
        restyle(self.fit, "" if patient.scan.is_astray else "primary")
        self.fit.setText("Fit again" if patient.fit else "Fit")
        self.fit.setEnabled(not patient.scan.blocked)
        self.fit.setToolTip(as_tip(sentence(patient.scan.blocked) or FIT_TIP))

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
        return [stop for row in self.rows.values() for stop in (row.check, *row.field.stops)]
