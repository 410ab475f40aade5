"""Of a patient: what the fit found, and whom it is compared with."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget

from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.curves import Standing
from naisr_viewer.state.explorer import AVERAGE_KEY, ExplorerState
from naisr_viewer.state.patients import Fitted
from naisr_viewer.views.patients.pieces import ChoiceBox, grid_in, paragraph, section, warnings
from naisr_viewer.words import curves
from naisr_viewer.words.patients import LONGEST_IN_TABLE, barred, breakable, findings, sentence
from naisr_viewer.words.titles import as_tip


def standings_part(standings: Sequence[Standing]) -> QWidget:
    """Where the measures of a patient stand among people of the same covariates."""
    part, table = QWidget(), QWidget()
    section(part, "Among people alike").addWidget(table)
    grid = grid_in(table, 12, 0, wide=1)
    top, right = Qt.AlignmentFlag.AlignTop, Qt.AlignmentFlag.AlignTop | Qt.AlignmentFlag.AlignRight
    for row, each in enumerate(standings):
        value, rank = curves.figure(each.value, each.unit), curves.rank(each)
        name, figure = paragraph(each.title, "muted", top), paragraph(value, "figure", right)
        figure.setAccessibleName(f"{each.title}: {value}, {rank}")
        grid.addWidget(name, 3 * row, 0)
        grid.addWidget(figure, 3 * row, 1)
        grid.addWidget(paragraph(rank, "muted", right), 3 * row + 1, 0, 1, 2)
        grid.setRowMinimumHeight(3 * row + 2, 6)
        for widget in (name, figure):
            widget.setToolTip(as_tip(curves.standing_hint(each)))
    return part


def result_part(fit: Fitted, atlas: AtlasCard) -> QWidget:
    """What ``fit`` found, and how sure it is."""
    part, table = QWidget(), QWidget()
    column = section(part, "Result")
    if not fit.is_valid:
        column.addWidget(paragraph("\n".join(map(sentence, fit.remarks)), "blocked"))
    column.addWidget(table)
    if fit.is_valid and fit.remarks:
        column.addWidget(warnings(fit.remarks))
    grid = grid_in(table, 12, 0, wide=1)
    top, right = Qt.AlignmentFlag.AlignTop, Qt.AlignmentFlag.AlignTop | Qt.AlignmentFlag.AlignRight
    for row, (what, value, sure) in enumerate(findings(fit, atlas)):
        figure = paragraph(breakable(value, LONGEST_IN_TABLE), "figure", right)
        figure.setAccessibleName(f"{what}: {value}")
        grid.addWidget(paragraph(breakable(what, LONGEST_IN_TABLE), "muted", top), 3 * row, 0)
        grid.addWidget(figure, 3 * row, 1)
        if sure:
            grid.addWidget(paragraph(breakable(sure), "muted", right), 3 * row + 1, 0, 1, 2)
        grid.setRowMinimumHeight(3 * row + 2, 6)
    return part


class ComparePart(QWidget):
    """Which fit the change is counted from."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.box = ChoiceBox("Compare with", "What “before” is in View > Before and after", self)
        section(self, "Compare with").addWidget(self.box)

    def show_state(self, state: ExplorerState) -> None:
        """Offer the other fitted patients; one whose fit is not valid is named, but cannot be chosen."""
        others = [
            (each, each.fit) for each in state.patients if each.fit is not None and each.key != state.patient
        ]
        choices = [
            (AVERAGE_KEY, "average at the same covariates"),
            (None, "this patient as fitted"),
            *((each.key, each.name) for each, _ in others),
        ]
        reasons = {each.key: barred(each.name, fit) for each, fit in others if not fit.is_valid}
        can_stay = state.compared in dict(choices) and state.compared not in reasons
        self.box.show_choices(choices, state.compared if can_stay else None, reasons)
