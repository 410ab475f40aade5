"""Of a patient: what was measured, and where it lies."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QFormLayout, QFrame, QHBoxLayout, QVBoxLayout, QWidget

from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.patients import Method, OpenScan, Reading
from naisr_viewer.views.dialogs.files import ask_landmarks_path
from naisr_viewer.views.elided import ElidedCheckBox, ElidedLabel
from naisr_viewer.views.patients.pieces import ChoiceBox, button, exchange, paragraph, section, warnings
from naisr_viewer.words.numbers import MILLIMETRES
from naisr_viewer.words.patients import METHODS, breakable, measured, sentence, units
from naisr_viewer.words.titles import as_tip

REREAD_TIP = "Read the file from the disk again, for example after it was edited"
RELABEL_TIP = "Read another label of the same volume; Ctrl+Z comes back to this one"
GHOST_TIP = "Draw what was measured, transparent, over the atlas's shape"
LIES_STILL = "Curves are fitted where they lie: give them in the frame of the atlas"
NO_UNIT = "The atlas's lengths have no unit: the numbers of the file are taken as they are"
SEE_FIRST = "The scan is drawn over the atlas as it lies; see that it fits before it is fitted."


class ScanPart(QWidget):
    """What was measured, and what is the matter with it."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.reread = button("Read again", REREAD_TIP, "small")
        self.relabel = button("Other label…", RELABEL_TIP, "small")
        self.reread_changed = button("Read again", REREAD_TIP)
        self.told_changed = ElidedLabel("File changed on disk")
        self.changed = QFrame()  # for the panel, which keeps it in sight
        self.changed.setObjectName("changed")
        self.source = paragraph()
        self.volume = paragraph(style="muted")
        self.blocked = paragraph(style="blocked")
        self.notes = QWidget()
        self._notes_shown: tuple[str, ...] = ()
        self.repairs = paragraph(style="muted")
        self.ghost = ElidedCheckBox("Show the scan over the shape", GHOST_TIP, self)
        self._compose()

    def show_patient(self, patient: OpenScan, has_ghost: bool, atlas: AtlasCard) -> None:
        """Show ``patient``'s scan."""
        scan = patient.scan
        self.source.setText(breakable(scan.source))
        self.source.setToolTip(as_tip(str(patient.reading.path)))
        self.volume.setText(measured(scan, atlas))
        if scan.notes != self._notes_shown:
            self._notes_shown = scan.notes
            self.notes = exchange(self.notes, warnings(scan.notes))
        self.notes.setVisible(bool(scan.notes))
        self.repairs.setText("\n".join(map(sentence, scan.repairs)))
        self.repairs.setVisible(bool(scan.repairs))
        self.blocked.setText(sentence(scan.blocked))
        self.blocked.setVisible(bool(scan.blocked))
        self.told_changed.set_hint(f"{patient.reading.path} has changed since it was read")
        self.reread.setVisible(not patient.is_changed)
        self.relabel.setVisible(patient.reading.label is not None)
        self.ghost.setChecked(has_ghost)

    def _compose(self) -> None:
        notice = QHBoxLayout(self.changed)
        notice.setContentsMargins(10, 8, 8, 8)
        notice.addWidget(self.told_changed, 1)
        notice.addWidget(self.reread_changed)
        facts = QVBoxLayout()
        facts.setSpacing(2)
        facts.addWidget(self.source)
        facts.addWidget(self.volume)
        column = section(self, "Scan", self.reread)
        column.addLayout(facts)
        column.addWidget(self.relabel, 0, Qt.AlignmentFlag.AlignLeft)
        for widget in (self.blocked, self.notes, self.repairs, self.ghost):
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

    def show_atlas(self, atlas: AtlasCard) -> None:
        """Offer what makes sense for its shapes, and say why nothing else does."""
        self.method.refuse(LIES_STILL if atlas.is_flat else "")
        self.unit.refuse("" if atlas.frame.unit == MILLIMETRES else NO_UNIT)

    def show_patient(self, patient: OpenScan, has_ghost: bool) -> None:
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
