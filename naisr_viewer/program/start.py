"""Starts the window: in the hands of a person, for pictures without one, or under a stop-watch.

Qt is imported when it is needed, so that the command line answers at once.
"""

from __future__ import annotations

import gc
import locale
import os
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import platformdirs

from naisr_viewer.engine.atlases import load_atlas, require_device
from naisr_viewer.engine.engine import Engine
from naisr_viewer.program.display import ensure_display, require_display

if TYPE_CHECKING:
    from PySide6.QtWidgets import QApplication

    from naisr_viewer.control.controller import Controller
    from naisr_viewer.state.atlas_card import AtlasCard
    from naisr_viewer.state.patients import Reading
    from naisr_viewer.views.main_window import MainWindow

SETTINGS = ("naisr", "naisr-viewer")
"""Under whose name the user's settings are kept."""


@dataclass(frozen=True)
class First:
    """What the window shows first.

    Attributes:
        path: an atlas file.
        card: of that atlas, where the engine has opened it already.
        values: real covariate values by name, then; the others are at their mean.
        scan: a patient's file to open.
        label: which label of it, where it is a volume.
        session: a session to open in place of all that.
    """

    path: Path
    card: AtlasCard | None = None
    values: Mapping[str, float] = field(default_factory=dict)
    scan: Path | None = None
    label: str | None = None
    session: Path | None = None

    @property
    def reading(self) -> Reading | None:
        """The scan as it is asked for."""
        from naisr_viewer.state.patients import Reading

        return None if self.scan is None else Reading(self.scan.absolute(), self.label)


def make_engine(device: str) -> Engine:
    """What computes surfaces, on a machine that is set up for a window beside it.

    Raises:
        InputError: when surfaces cannot be computed on ``device``.
    """
    leave_a_core_to_the_window()
    remember_few_kernels()
    gc.disable()  # a worker could come to delete what is Qt's, which aborts the program; see control/thrift
    require_device(device)
    return Engine(partial(load_atlas, device=device))


def leave_a_core_to_the_window() -> None:
    """Bound the threads that compute surfaces, unless the user has; torch reads this when imported.

    With a thread on every core the window and the computation wait for each other, and waiting threads
    spin: on two busy cores a preview then takes several times as long.
    """
    os.environ.setdefault("OMP_NUM_THREADS", str(max(1, (os.cpu_count() or 2) - 1)))
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")


def remember_few_kernels() -> None:
    """Bound what torch keeps of the machine code it makes for each size of a product, unless the user has.

    Bands of surfaces have ever different sizes: the thousand that it would remember take some 250 MB and are
    seldom met again.
    """
    os.environ.setdefault("ONEDNN_PRIMITIVE_CACHE_CAPACITY", "64")


def make_window(
    engine: Engine, settings_file: Path | None = None, is_attended: bool = False, kept: Path | None = None
) -> tuple[MainWindow, Controller]:
    """A window and what drives it; the application object exists already.

    Args:
        engine: computes the surfaces.
        settings_file: an INI file for recent files and theme instead of the user's own settings.
        is_attended: whether somebody sits there who can be asked.
        kept: where what is on screen is kept for the next run; None where nobody comes back.
    """
    from PySide6.QtCore import QSettings

    from naisr_viewer.control.atlas_watch import AtlasWatch
    from naisr_viewer.control.controller import Controller
    from naisr_viewer.control.copying import CopyDesk
    from naisr_viewer.control.desk import PatientDesk
    from naisr_viewer.control.matrix import MatrixDesk
    from naisr_viewer.control.measuring import CurveDesk, NormsDesk
    from naisr_viewer.control.pinning import PinDesk
    from naisr_viewer.control.playing import Player
    from naisr_viewer.control.preferences import Preferences
    from naisr_viewer.control.section import SectionDesk
    from naisr_viewer.control.sessions import SessionDesk
    from naisr_viewer.control.worker import Worker
    from naisr_viewer.engine.clinic import Clinic
    from naisr_viewer.views.main_window import MainWindow

    if settings_file is None:
        settings = QSettings(*SETTINGS)
    else:
        settings = QSettings(str(settings_file), QSettings.Format.IniFormat)
    window = MainWindow()
    controller = Controller(window, engine, Worker(), Worker(), Preferences(settings), is_attended)
    clinic = Clinic(engine)
    PatientDesk(window, controller, clinic)  # the controller owns it
    AtlasWatch(controller)  # and this
    PinDesk(window, controller, engine, Worker(), Worker())  # and this
    CurveDesk(window, controller, engine, Worker())  # and this
    NormsDesk(window, controller, engine, Worker())  # and this
    SessionDesk(window, controller, engine, clinic, Worker(), Worker(), kept)  # and this
    MatrixDesk(window, controller, engine)  # and this
    Player(window, controller)  # and this
    SectionDesk(window, controller)  # and this
    CopyDesk(window, controller)  # and this
    return window, controller


def kept_session() -> Path:
    """Where what is on screen is kept from one run to the next."""
    return platformdirs.user_state_path("naisr-viewer", appauthor=False) / "session.json"


def make_application() -> QApplication:
    """The one application object, styled alike on every platform.

    Qt takes over the user's locale, decimal comma included, and every C library in the process would follow.

    Raises:
        InputError: when shapes cannot be drawn on this display.
    """
    from PySide6.QtWidgets import QApplication

    from naisr_viewer.program.opengl import require_opengl

    app = QApplication.instance() or QApplication(["naisr-viewer"])
    assert isinstance(app, QApplication)
    locale.setlocale(locale.LC_NUMERIC, "C")
    app.setApplicationName("naisr-viewer")
    app.setStyle("Fusion")
    require_opengl()
    return app


def attended(engine: Engine, first: First, pixels: tuple[int, int] | None) -> int:
    """The window in the hands of a person, until it is closed; without ``pixels`` as large as it was last."""
    from PySide6.QtCore import QSettings, Qt

    from naisr_viewer.control.preferences import Preferences
    from naisr_viewer.program.placing import place

    require_display()
    app = make_application()

    from naisr_viewer.program.interrupts import ending_at_once

    window, controller = make_window(engine, is_attended=True, kept=kept_session())
    if (reading := first.reading) is not None:
        once = Qt.ConnectionType.SingleShotConnection
        controller.refinement.settled.connect(lambda: window.reading_requested.emit(reading), once)
    place(window, pixels, Preferences(QSettings(*SETTINGS)))
    with ending_at_once():
        show(window, controller, first)
        return app.exec()


def show(window: MainWindow, controller: Controller, first: First) -> None:
    """Put the window on the screen first; what takes long starts behind it."""

    def begin() -> None:
        window.shapes.prepare()
        if first.session is not None:
            window.session_requested.emit(first.session)
        elif first.card is None:
            controller.open(first.path)
        else:
            controller.show_atlas(first.card, first.values)

    sys.excepthook = controller.report
    window.show_opening((first.session or first.path).name)
    window.appeared.connect(begin)
    window.show()


def measured(engine: Engine, path: Path, pixels: tuple[int, int], file: Path, loaded: float) -> int:
    """The window as a person starts and drags it, with a stop-watch, writing the figures to ``file``.

    Args:
        engine: computes the surfaces.
        path: an atlas file.
        pixels: size of the window.
        file: JSON, to be written.
        loaded: when the program was, on the monotonic clock.
    """
    before = time.monotonic()
    ensure_display(pixels)
    display_s = time.monotonic() - before  # whoever sits at a display does not wait for a virtual one
    with own_window(engine) as (window, controller):
        from naisr_viewer.program.measure import Observer, measure, process_start

        observer = Observer(window, controller)
        window.resize(*pixels)
        show(window, controller, First(path))
        measure(window, controller, engine, observer, process_start(loaded) + display_s, file)
    print(f"wrote {file}")
    return 0


def unattended(
    engine: Engine, first: First, pixels: tuple[int, int], screenshot: Path | None, demo: Path | None
) -> int:
    """The same window without a person.

    Raises:
        InputError: when something is not as it was asked for, or as it was saved.
    """
    from naisr_viewer.engine.clinic import Clinic
    from naisr_viewer.program import headless

    if first.reading is not None:
        Clinic.require_label(first.reading, first.card)
    ensure_display(pixels)
    with own_window(engine) as (window, controller):
        window.resize(*pixels)
        window.show()
        if first.session is not None:
            window.session_requested.emit(first.session)
        elif first.card is not None:
            controller.show_atlas(first.card, first.values)
        if first.reading is not None:
            headless.finish(window, controller)
            window.reading_requested.emit(first.reading)
        if screenshot is not None:
            headless.take_screenshot(window, controller, screenshot)
        if demo is not None:
            headless.run_demo(window, controller, demo)
    return 0


@contextmanager
def own_window(engine: Engine) -> Iterator[tuple[MainWindow, Controller]]:
    """A window that leaves no trace in the user's settings, closed at the end."""
    make_application()

    from naisr_viewer.program.interrupts import ending_at_once

    folder = TemporaryDirectory(prefix="naisr-viewer-")
    with folder, ending_at_once(folder.cleanup):
        window, controller = make_window(engine, Path(folder.name) / "settings.ini")
        try:
            yield window, controller
        finally:
            window.close()
