"""The right side: the scans that are open, and of the one that is shown all there is to say and to do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from PySide6.QtCore import QEvent, QObject, QSize, Qt, QTimer, Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QScrollArea, QVBoxLayout, QWidget

from naisr_model.covariates import Covariate
from naisr_viewer.panels.kinds import layouts_of
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.curves import Standing
from naisr_viewer.state.explorer import ExplorerState, unfitted
from naisr_viewer.state.layouts import Layout
from naisr_viewer.state.patients import Named, OpenScan
from naisr_viewer.views.focus import in_order
from naisr_viewer.views.patients.known import KnownPart, NumberField
from naisr_viewer.views.patients.list import PatientList
from naisr_viewer.views.patients.pieces import button, exchange, paragraph
from naisr_viewer.views.patients.result import ComparePart, result_part, standings_part
from naisr_viewer.views.patients.scan import AlignmentPart, ScanPart
from naisr_viewer.views.patients.together import TogetherPart
from naisr_viewer.words.numbers import capitalised
from naisr_viewer.words.patients import scans_of

PANEL_WIDTH = 300
LEAST_WIDTH = 248
MARGIN_PX = 14


class PatientPanel(QFrame):
    """The open scans, and of the one that is shown all there is to say and to do."""

    open_requested = Signal()  # "Open scan…" was pressed
    patient_chosen = Signal(object)  # key, or None for the population average
    close_requested = Signal(int)  # key
    reread_requested = Signal()  # the shown patient's file shall be read again
    reading_changed = Signal(object)  # a Reading of the same file with another alignment or unit
    table_chosen = Signal(object)  # Path of a table that says what is known of the open scans
    fit_all_requested = Signal(object)  # what is known of each open scan: Named by its key
    fit_requested = Signal(tuple)  # Named, the known covariates in the atlas's order
    compared_chosen = Signal(object)  # key, or None for the patient as fitted
    ghost_toggled = Signal(bool)  # whether the scan is drawn over the shape

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("patientBar")
        self.setMinimumWidth(LEAST_WIDTH)
        self.setMaximumWidth(PANEL_WIDTH)
        self._state = ExplorerState()
        self._drafts: dict[int, tuple[Named, Named]] = {}  # what was known when it was typed, and what was
        self._area = QScrollArea(self)
        self._inside = QWidget(self._area)
        self._head, self._foot = QWidget(self), QWidget(self)
        self.open = button("Open scan…", "")
        self.invitation = paragraph(style="muted")
        self.list = PatientList(self._inside)
        self.together = TogetherPart(self._inside)
        self.scan = ScanPart(self._inside)
        self.alignment = AlignmentPart(self._inside)
        self.known = KnownPart(self._inside)
        self.result, self.standings = QWidget(), QWidget()
        self.compare = ComparePart(self._inside)
        self._compose()
        self._connect()
        self.show_state(self._state)

    def show_state(self, state: ExplorerState) -> None:
        """Bring the panel to ``state``, touching only what changed; what is being typed stays."""
        old, self._state = self._state, state
        if state.atlas is not None and state.atlas is not old.atlas:
            self._drafts = {}
            self._show_rows(state.atlas.covariates)
            self._say_what_opens(state.atlas)
        self._show_known(old.shown if state.atlas is old.atlas else None, state.shown)
        self.open.setEnabled(state.atlas is not None)
        self.invitation.setVisible(not state.patients)
        self.list.setVisible(bool(state.patients))
        self.list.show_patients(state.patients, state.patient, state.atlas)
        self.together.show_patients(state.patients, len(unfitted(state)))
        for part in (self.scan, self.alignment, self.known, self._foot):
            part.setVisible(state.shown is not None)
        self.result.setVisible(state.fit is not None)
        can_compare = state.atlas is not None and Layout.CHANGE in layouts_of(state.atlas)
        self.compare.setVisible(state.can_forecast and can_compare)
        self.scan.changed.setVisible(state.shown is not None and state.shown.is_changed)
        if state.shown is not None:
            self._show_patient(state.shown, old.shown)

    def show_standings(self, standings: Sequence[Standing]) -> None:
        """Say where the measures of the patient that is shown stand among people; none takes that away."""
        self.standings = exchange(self.standings, standings_part(standings) if standings else QWidget())
        self.standings.setVisible(bool(standings))

    def reveal_standings(self) -> None:
        """Scroll to where the measures stand."""
        self._area.ensureWidgetVisible(self.standings, 0, 16)

    def sizeHint(self) -> QSize:
        """As wide as it may be; a narrow window gives it less."""
        return QSize(PANEL_WIDTH, super().sizeHint().height())

    @property
    def stops(self) -> list[QWidget]:
        """What the Tab key goes through, as it is read."""
        top = [
            self.open,
            self.scan.reread_changed,
            self._area,
            self.list,
            self.together.known,
            self.together.fit,
            self.scan.reread,
            self.scan.relabel,
            self.scan.ghost,
        ]
        middle = [self.alignment.method, self.alignment.unit, *self.known.stops()]
        return [*top, *middle, self.compare.box, self.known.align, self.known.fit]

    def set_editable(self, editable: bool) -> None:
        """Whether anything can be changed just now; it can be read and scrolled in any case."""
        for part in (self._head, self.scan.changed, self._inside, self._foot):
            part.setEnabled(editable)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Let the wheel scroll the panel instead of changing what lies under the pointer."""
        if event.type() != QEvent.Type.Wheel or (isinstance(watched, NumberField) and watched.hasFocus()):
            return super().eventFilter(watched, event)
        event.ignore()
        return True

    def _show_known(self, old: OpenScan | None, new: OpenScan | None) -> None:
        """What was typed belongs to its patient and is found again when that is shown again."""
        if old is not None and (new is None or new.key != old.key):
            self._drafts[old.key] = (old.known, self.known.given())
        if new is None:
            return
        if old is None or old.key != new.key:
            self.known.give(self._draft(new))
        elif new.known != old.known and (new.known or new.fit):
            self.known.give(new.known)

    def _typed(self) -> dict[int, Named]:
        """What is known of each open scan, what was typed and not yet used too."""
        typed = {each.key: self._draft(each) for each in self._state.patients}
        return typed | ({} if self._state.shown is None else {self._state.shown.key: self.known.given()})

    def _draft(self, patient: OpenScan) -> Named:
        known, typed = self._drafts.get(patient.key, (patient.known, patient.known))
        return typed if known == patient.known else patient.known

    def _show_patient(self, new: OpenScan, old: OpenScan | None) -> None:
        state = self._state
        assert state.atlas is not None
        self.scan.show_patient(new, state.has_ghost, state.atlas)
        self.alignment.show_patient(new, state.has_ghost)
        self.known.show_patient(new)
        self.compare.show_state(state)
        if new.fit is not None and (old is None or new.fit is not old.fit):
            self.result = exchange(self.result, result_part(new.fit, state.atlas))
            if old is not None and old.key == new.key:
                QTimer.singleShot(0, self, self._reveal_result)

    def _reveal_result(self) -> None:
        """Scroll to what was just found, once it has its place."""
        self._area.ensureWidgetVisible(self.result, 0, 16)

    def _point_at_position(self) -> None:
        """Scroll to the choice of the alignment and open it."""
        self._area.ensureWidgetVisible(self.alignment.method, 0, 16)
        self.alignment.method.setFocus()
        self.alignment.method.showPopup()

    def _say_what_opens(self, atlas: AtlasCard) -> None:
        """Which files hold a patient's shape; curves are fitted where they lie."""
        self.open.setToolTip(capitalised(scans_of(atlas)))
        self.invitation.setText(f"Open a scan to fit the atlas to it: {scans_of(atlas)}.")
        self.alignment.show_atlas(atlas)

    def _show_rows(self, covariates: Sequence[Covariate]) -> None:
        """Made later than what stands below them, so that the Tab key has to be told."""
        self.known.show_covariates(covariates)
        in_order(self.stops)
        for stop in self.known.stops():
            stop.installEventFilter(self)

    def _compose(self) -> None:
        """What concerns the shown patient scrolls; what opens, warns and fits stays in sight."""
        column = QVBoxLayout(self._inside)
        column.setContentsMargins(MARGIN_PX, 2, MARGIN_PX, 12)
        column.setSpacing(20)
        for part in (
            self.invitation,
            self.list,
            self.together,
            self.scan,
            self.alignment,
            self.known,
            self.result,
            self.standings,
        ):
            column.addWidget(part)
        column.addWidget(self.compare)
        column.addStretch(1)
        self._area.setWidget(self._inside)
        self._area.setWidgetResizable(True)
        self._area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        warning = QVBoxLayout()
        warning.setContentsMargins(MARGIN_PX, 0, MARGIN_PX, 8)
        warning.addWidget(self.scan.changed)
        foot = QHBoxLayout(self._foot)
        foot.setContentsMargins(MARGIN_PX, 8, MARGIN_PX, 10)
        foot.addWidget(self.known.align)
        foot.addWidget(self.known.fit, 1)
        outer = QVBoxLayout(self)
        outer.setContentsMargins(1, 0, 0, 0)
        outer.setSpacing(0)
        outer.addWidget(self._head)
        outer.addLayout(warning)
        outer.addWidget(self._area, 1)
        outer.addWidget(self._foot)
        self._compose_head()

    def _compose_head(self) -> None:
        title = QLabel("Patients")
        title.setObjectName("title")
        head = QHBoxLayout(self._head)
        head.setContentsMargins(MARGIN_PX, 16, MARGIN_PX, 8)
        head.addWidget(title, 1)
        head.addWidget(self.open)

    def _read_another_label(self) -> None:
        """Which one is asked as it was when the file was opened."""
        if self._state.shown is not None:
            self.reading_changed.emit(replace(self._state.shown.reading, label=None))

    def _connect(self) -> None:
        self.open.clicked.connect(self.open_requested)
        self.list.patient_chosen.connect(self.patient_chosen)
        self.list.close_requested.connect(self.close_requested)
        self.together.table_chosen.connect(self.table_chosen)
        self.together.fit.clicked.connect(lambda: self.fit_all_requested.emit(self._typed()))
        self.scan.relabel.clicked.connect(self._read_another_label)
        for reread in (self.scan.reread, self.scan.reread_changed):
            reread.clicked.connect(self.reread_requested)
        self.scan.ghost.clicked.connect(self.ghost_toggled)
        self.alignment.reading_changed.connect(self.reading_changed)
        self.known.align.clicked.connect(self._point_at_position)
        self.known.fit.clicked.connect(lambda: self.fit_requested.emit(self.known.given()))
        self.compare.box.activated.connect(lambda: self.compared_chosen.emit(self.compare.box.currentData()))
        for box in (self.alignment.method, self.alignment.unit, self.compare.box):
            box.installEventFilter(self)
