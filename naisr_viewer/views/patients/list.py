"""The scans that are open, one a row."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, QSize, Qt, Signal
from PySide6.QtGui import QKeyEvent, QResizeEvent
from PySide6.QtWidgets import (
    QHBoxLayout,
    QLabel,
    QListWidget,
    QListWidgetItem,
    QToolButton,
    QWidget,
)

from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.patients import OpenScan
from naisr_viewer.views.colours import patient_colour
from naisr_viewer.views.elided import ElidedLabel
from naisr_viewer.words.patients import found_volume
from naisr_viewer.words.titles import as_tip

ROWS_IN_SIGHT = 4
"""How many rows of the list are shown before it scrolls."""

ROW_HEIGHT = 30
LIST_BORDER = 8

AVERAGE = "Population average"


class PatientList(QListWidget):
    """The population average and the open patients."""

    patient_chosen = Signal(object)  # key, or None for the population average
    close_requested = Signal(int)  # key

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setObjectName("patientList")
        self.setAccessibleName("Patients")
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.currentItemChanged.connect(lambda _item: self.patient_chosen.emit(self._key()))
        self._patients: tuple[OpenScan, ...] = ()

    def show_patients(
        self, patients: tuple[OpenScan, ...], shown: int | None, atlas: AtlasCard | None
    ) -> None:
        """Bring the rows up to date and mark the one that is shown."""
        with QSignalBlocker(self):
            if patients != self._patients:
                self._patients = patients
                self._fill(atlas)
            self.setCurrentRow([None, *(patient.key for patient in patients)].index(shown))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Delete closes the patient."""
        key = self._key()
        if event.key() == Qt.Key.Key_Delete and key is not None:
            self.close_requested.emit(key)
        else:
            super().keyPressEvent(event)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Make what stands in the rows as wide as the list; Qt itself leaves it as it was."""
        super().resizeEvent(event)
        self.scheduleDelayedItemsLayout()

    def _fill(self, atlas: AtlasCard | None) -> None:
        self.clear()
        self._add(AVERAGE, "", "The atlas without anybody's own shape")
        for patient in self._patients:
            assert atlas is not None  # scans are of an atlas
            close, found = self._close_button(patient), found_volume(patient.fit, atlas)
            self._add(patient.name, found, str(patient.reading.path), patient.key, close)
        self.setFixedHeight(min(self.count(), ROWS_IN_SIGHT) * ROW_HEIGHT + LIST_BORDER)

    def _add(self, name: str, note: str, tip: str, key: int | None = None, *beside: QWidget) -> None:
        item = QListWidgetItem(self)
        item.setData(Qt.ItemDataRole.UserRole, key)
        item.setData(Qt.ItemDataRole.AccessibleTextRole, f"{name}, {note}".removesuffix(", "))
        item.setToolTip(as_tip(tip))
        item.setSizeHint(QSize(0, ROW_HEIGHT))
        muted = QLabel(note)
        muted.setObjectName("muted")
        row = QWidget()
        line = QHBoxLayout(row)
        line.setContentsMargins(9, 0, 4, 0)
        line.setSpacing(6)
        if key is not None:
            line.addWidget(_sign(key))
        line.addWidget(ElidedLabel(name), 1)
        for widget in (muted, *beside):
            line.addWidget(widget)
        self.setItemWidget(item, row)

    def _close_button(self, patient: OpenScan) -> QToolButton:
        close = QToolButton()
        close.setText("×")
        close.setAutoRaise(True)
        close.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        close.setToolTip("Close this patient (Delete); the file stays as it is")
        close.setAccessibleName(f"Close {patient.name}")
        key = patient.key  # what Qt holds on to must not hold the scan
        close.clicked.connect(lambda: self.close_requested.emit(key))
        return close

    def _key(self) -> int | None:
        item = self.currentItem()
        return item.data(Qt.ItemDataRole.UserRole) if item else None


def _sign(key: int) -> QLabel:
    """What marks a patient among the data."""
    sign = QLabel("▲")
    sign.setStyleSheet(f"color: {patient_colour(key)}; font-size: 8pt;")
    return sign
