"""What the user does with patients: open, align, fit, compare, read again, close."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import count
from pathlib import Path

from PySide6.QtCore import QObject

from naisr_model.errors import InputError
from naisr_model.files import Stamp, stamp_of
from naisr_viewer.control import jobs
from naisr_viewer.control.controller import Controller
from naisr_viewer.control.watch import FileWatch
from naisr_viewer.engine.clinic import Clinic
from naisr_viewer.state.explorer import (
    showing,
    stated_of,
    unfitted,
    with_changed,
    with_patient,
    with_stated,
    without_patient,
)
from naisr_viewer.state.layouts import Layout
from naisr_viewer.state.patients import Fitted, Labels, Named, OpenScan, Reading, Scan, Stated
from naisr_viewer.views.main_window import MainWindow
from naisr_viewer.words.numbers import in_words
from naisr_viewer.words.patients import doubt
from naisr_viewer.words.titles import label


@dataclass(frozen=True)
class Order:
    """A patient's file to be read.

    Attributes:
        key: of the patient, new or known.
        reading: how.
        known: what is known of the covariates.
    """

    key: int
    reading: Reading
    known: Named


class PatientDesk(QObject):
    """Wires the patient panel.

    Args:
        window: shows the patients.
        controller: holds the state and runs the jobs.
        clinic: reads and fits.
    """

    def __init__(self, window: MainWindow, controller: Controller, clinic: Clinic) -> None:
        super().__init__(controller)
        self._window, self._controller, self._clinic = window, controller, clinic
        self._keys = count(1)
        self._waiting: deque[Order] = deque()
        self._failures: list[str] = []
        self._files = FileWatch(self)
        self._files.touched.connect(self._look_at_files)
        controller.refinement.settled.connect(self._read_next)
        controller.refinement.settled.connect(self._watch)
        controller.travelled.connect(self._look_at_files)
        window.scan_requested.connect(self.open)
        window.reading_requested.connect(self.read)
        panel = window.patients
        panel.patient_chosen.connect(self.show)
        panel.close_requested.connect(self.close)
        panel.reading_changed.connect(self.read_differently)
        panel.reread_requested.connect(self.read_again)
        panel.fit_requested.connect(self.fit)
        panel.fit_all_requested.connect(self.fit_all)
        panel.table_chosen.connect(self.take_known)
        panel.compared_chosen.connect(self.compare)
        panel.ghost_toggled.connect(self.set_ghost)

    def open(self, path: Path) -> None:
        """Read a patient's file beside the window, and show it over the population's average."""
        self.read(Reading(path.absolute()))

    def read(self, reading: Reading) -> None:
        """The same in a given way."""
        if self._controller.state.atlas is None:
            self._window.show_error("Open an atlas first; a scan is fitted to it.")
            return
        self._read(Order(self._new_key(), reading, self._known_of(reading)))

    def show(self, key: int | None) -> None:
        """Show another patient, or the population average."""
        self._controller.go(showing(self._controller.state, key))

    def close(self, key: int) -> None:
        """Take a patient from the list; undo brings it back, with its fit."""
        patient = self._controller.state.find(key)
        if patient is None:
            return
        self._controller.commit(without_patient(self._controller.state, key))
        self._controller.refinement.tell(f"Closed {patient.name} · Ctrl+Z brings it back")
        self._watch()

    def read_differently(self, reading: Reading) -> None:
        """Read the patient's file with another unit or alignment."""
        patient, known = self._controller.state.shown, self._window.patients.known.given()
        if self._is_refused(known):
            self._window.show_state(self._controller.state)
        elif patient is not None:
            self._read(Order(patient.key, reading, known))

    def read_again(self) -> None:
        """Read the patient's file anew, as another patient, so that both can be compared."""
        patient = self._controller.state.shown
        if patient is not None:
            self._read(Order(self._new_key(), patient.reading, self._window.patients.known.given()))

    def fit(self, known: Named) -> None:
        """Fit the atlas to the patient that is shown; covariates that are not known are inferred."""
        atlas, patient = self._controller.state.atlas, self._controller.state.shown
        if atlas is None or patient is None or self._is_refused(known):
            return
        job = jobs.fitting(self._clinic, atlas.path, patient.scan, known)
        self._controller.refinement.run(
            f"Fitting {patient.name} …", job, partial(self._show_fit, patient, known)
        )

    def fit_all(self, known: Mapping[int, Named]) -> None:
        """Fit the atlas to every open scan that has no fit, one after the other.

        Args:
            known: of each open scan, by its key.
        """
        atlas = self._controller.state.atlas
        chosen = [(each, known[each.key]) for each in unfitted(self._controller.state)]
        if atlas is None or any(self._is_refused(values, f"{each.name}: ") for each, values in chosen):
            return
        told = f"Fitting {len(chosen)} scans …"
        self._failures = []
        job = jobs.fitting_all(self._clinic, atlas.path, chosen)
        self._controller.refinement.run(told, job, self._show_one_of_all)

    def take_known(self, table: Path) -> None:
        """Take what is known of the open scans from a table."""
        atlas = self._controller.state.atlas
        if atlas is not None:
            job = jobs.reading_table(self._clinic, atlas.path, table)
            self._controller.refinement.run(f"Reading {table.name} …", job, partial(self._show_stated, table))

    def compare(self, key: int | None) -> None:
        """Count changes from another patient; None for this patient as fitted."""
        self._controller.commit(replace(self._controller.state, compared=key))

    def set_ghost(self, has_ghost: bool) -> None:
        """Whether the scan is drawn over the full shape."""
        self._controller.go(replace(self._controller.state, has_ghost=has_ghost))

    def _is_refused(self, known: Named, whose: str = "") -> bool:
        """Whether a covariate is where the atlas knows nobody; says so, and first ``whose`` it is."""
        atlas = self._controller.state.atlas
        assert atlas is not None
        for name, value in known:
            covariate = atlas.covariates[atlas.index(name)]
            if not covariate.contains(value):
                told = "no number" if math.isnan(value) else covariate.format(value)
                self._window.show_error(
                    f"{whose}{label(name)} is {told}; the atlas was made from {covariate.extent}. "
                    "Correct it, or untick it to have it inferred."
                )
                return True
        return False

    def _read(self, order: Order) -> None:
        """Read now, or when what is under way has ended; of several files every error can be read."""
        if not (self._waiting or self._controller.refinement.is_occupied):
            self._controller.refinement.forget_errors()
        self._waiting.append(order)
        self._read_next()

    def _read_next(self) -> None:
        atlas, refinement = self._controller.state.atlas, self._controller.refinement
        if atlas is None or not self._waiting or refinement.is_occupied:
            return
        order = self._waiting.popleft()
        path = order.reading.path
        job = jobs.reading(self._clinic, atlas.path, order.reading, order.known)
        refinement.go_on(f"Reading {path.name} …", job, partial(self._has_read, order, stamp_of(path)))

    def _has_read(self, order: Order, stamp: Stamp, found: Scan | Labels) -> None:
        if isinstance(found, Scan):
            self._show_read(order, stamp, found)
        elif (chosen := self._window.ask_label(found)) is not None:
            self._read(replace(order, reading=replace(order.reading, label=chosen)))

    def _show_read(self, order: Order, stamp: Stamp, scan: Scan) -> None:
        """A scan that was read differently has to be fitted again; undo brings back how it was."""
        old = self._controller.state.find(order.key)
        name = old.name if old is not None else self._name(order.reading)
        patient = OpenScan(
            order.key, name, order.reading, scan, order.known, written=stamp, aligned_at=order.known
        )
        self._controller.commit(with_patient(self._controller.state, patient))
        self._watch()
        self._look_at_files()

    def _show_fit(self, fitted: OpenScan, known: Named, found: tuple[Fitted, Scan]) -> None:
        """A fit that came to its end, unless its patient was closed or read differently meanwhile."""
        if (placed := self._placed(fitted, known, found)) is not None:
            state = with_patient(self._controller.state, placed)
            layout = Layout.FIT if fitted.fit is None else state.layout
            self._controller.commit(replace(state, layout=layout))

    def _placed(self, fitted: OpenScan, known: Named, found: tuple[Fitted, Scan]) -> OpenScan | None:
        """The patient with a fit; None where it has come too late."""
        (fit, scan), patient = found, self._controller.state.find(fitted.key)
        if patient is None or patient.scan is not fitted.scan:
            self._clinic.forget(fit)
            return None
        return replace(patient, known=known, scan=scan, fit=fit)

    def _show_one_of_all(self, outcome: jobs.Outcome) -> None:
        """One of several fits; who is shown stays until the own fit has come."""
        patient, known, found = outcome
        if isinstance(found, InputError):
            self._failures.append(f"{patient.name}: {in_words(found)}")
            self._window.show_error("\n".join(self._failures))
        elif patient.key == self._controller.state.patient:
            self._show_fit(patient, known, found)
        elif (placed := self._placed(patient, known, found)) is not None:
            self._controller.commit(with_changed(self._controller.state, placed))

    def _show_stated(self, table: Path, stated: tuple[Stated, ...]) -> None:
        """What a table says of the open scans, and of which it says nothing, or nothing that can be used."""
        state = self._controller.state
        if (new := with_stated(state, stated)).patients != state.patients:
            self._controller.commit(new)
        doubts = [told for each in state.patients if (told := doubt(each.name, stated_of(each, stated)))]
        self._window.show_error("\n".join(f"{table.name}: {told}" for told in doubts))
        count = len(state.patients) - len(doubts)
        self._controller.refinement.tell(f"Known of {count} of {len(state.patients)} scans by {table.name}")

    def _new_key(self) -> int:
        """One that nobody has who is open; those of a session are not counted here."""
        taken = {each.key for each in self._controller.state.patients}
        return next(key for key in self._keys if key not in taken)

    def _known_of(self, reading: Reading) -> Named:
        """What is known of an open patient with the same file."""
        state = self._controller.state
        same = (each.known for each in reversed(state.patients) if each.reading.path == reading.path)
        return next(same, ())

    def _name(self, reading: Reading) -> str:
        """The file's name, numbered where it is open already."""
        names = {each.name for each in self._controller.state.patients}
        plain = reading.path.name
        numbered = (f"{plain} ({number})" for number in count(2))
        return plain if plain not in names else next(name for name in numbered if name not in names)

    def _watch(self) -> None:
        """Be told when another program writes one of the files."""
        self._files.watch(each.reading.path for each in self._controller.state.patients)

    def _look_at_files(self) -> None:
        state = self._controller.state
        patients = tuple(
            replace(each, is_changed=stamp_of(each.reading.path) not in (None, each.written))
            for each in state.patients
        )
        if [each.is_changed for each in patients] != [each.is_changed for each in state.patients]:
            self._controller.go(replace(state, patients=patients))
        self._watch()
