"""Start-up: ``naisr-viewer [ATLAS]``. Nothing heavy is imported before the arguments are read."""

from __future__ import annotations

import gc
import os
import signal
import sys
import time
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import cyclopts
from cyclopts import Parameter

from naisr_model.errors import InputError
from naisr_model.shipped import shipped_atlas
from naisr_viewer import __version__
from naisr_viewer.engine.engine import Engine, load_atlas

if TYPE_CHECKING:
    from PySide6.QtWidgets import QApplication

    from naisr_viewer.control.controller import Controller
    from naisr_viewer.state.explorer import AtlasCard
    from naisr_viewer.views.main_window import MainWindow

LOADED = time.monotonic()
"""When the program was loaded, where the system does not tell when it was started."""

cli = cyclopts.App(
    name="naisr-viewer",
    help="Explore how anatomy changes with age, weight, sex and other covariates.",
    version=__version__,
    help_on_error=False,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit code: 0, or 2 after one sentence on stderr."""
    try:
        tokens = list(sys.argv[1:] if arguments is None else arguments)
        return cli(tokens, exit_on_error=False, print_error=False, result_action="return_value") or 0
    except (InputError, cyclopts.CycloptsError) as error:
        print(f"naisr-viewer: {error}", file=sys.stderr)
        return 2


@cli.default
def view(
    atlas: Path | None = None,
    /,
    *,
    settings: Annotated[list[str] | None, Parameter("--set", negative=())] = None,
    scan: Path | None = None,
    screenshot: Path | None = None,
    demo: Path | None = None,
    measure: Path | None = None,
    size: str = "1280x800",
    device: str = "cpu",
) -> int:
    """Open the window on an atlas.

    Parameters
    ----------
    atlas
        A trained atlas (.safetensors); the airway atlas that comes with the program when left out.
    settings
        Where a covariate starts, as NAME=VALUE in real units: --set age=120 --set sex=M.
    scan
        A patient's file to open at once: a mesh, a label volume or a cloud of points.
    screenshot
        Write a picture of the window to this PNG file and end; needs no display.
    demo
        Drag every slider from end to end, write pictures and meshes into this folder and end;
        needs no display.
    measure
        Time the start and a drag of a slider, write the figures to this JSON file and end;
        needs no display.
    size
        Size of the window in pixels, WIDTHxHEIGHT.
    device
        Where exact surfaces are computed: cpu, cuda or mps.
    """
    path = (atlas or shipped_atlas()).absolute()
    pixels = parse_size(size)
    if not path.is_file():
        raise InputError(f"there is no file {path}; give the path of an atlas (.safetensors)")
    leave_a_core_to_the_window()
    gc.set_threshold(50_000)  # imports make many objects that stay: seldom worth looking through
    engine = Engine(partial(load_atlas, device=device))
    if measure is not None:
        return _measured(engine, path, pixels, measure)
    card = engine.open(path) if settings or screenshot or demo else None
    values = parse_settings(card, settings or []) if card else {}
    if card is not None and (screenshot or demo):
        return _unattended(engine, card, values, scan, pixels, screenshot, demo)
    return _attended(engine, path, card, values, scan, pixels)


def leave_a_core_to_the_window() -> None:
    """Bound the threads that compute surfaces, unless the user has; torch reads this when imported.

    With a thread on every core the window and the computation wait for each other, and waiting threads
    spin: on two busy cores a preview then takes several times as long.
    """
    os.environ.setdefault("OMP_NUM_THREADS", str(max(1, (os.cpu_count() or 2) - 1)))
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")


def parse_settings(card: AtlasCard, settings: Sequence[str]) -> dict[str, float]:
    """``["age=120", "sex=M"]`` as real values by name.

    Raises:
        InputError: for an unknown covariate, no number, or a value outside the observed range.
    """
    known = {covariate.name: covariate for covariate in card.covariates}
    values = {}
    for setting in settings:
        name, equals, text = setting.partition("=")
        if not equals or name.strip() not in known:
            raise InputError(
                f"--set {setting} is not understood; write NAME=VALUE, NAME one of {', '.join(known)}"
            )
        covariate = known[name.strip()]
        value = covariate.parse(text)
        low, high = covariate.range
        if not low <= value <= high:
            seen = f"{low:g} to {high:g} {covariate.unit}".strip()
            raise InputError(f"--set {setting} is out of range; the atlas was made from {seen}")
        values[covariate.name] = value
    return values


def parse_size(text: str) -> tuple[int, int]:
    """``1280x800`` as two numbers.

    Raises:
        InputError: when it is anything else.
    """
    width, _, height = text.lower().partition("x")
    if not (width.isdigit() and height.isdigit() and int(width) >= 640 and int(height) >= 480):
        raise InputError(f"--size {text} is not understood; write WIDTHxHEIGHT, at least 640x480")
    return int(width), int(height)


def make_window(engine: Engine, settings_file: Path | None = None) -> tuple[MainWindow, Controller]:
    """A window and what drives it; the application object exists already.

    Args:
        engine: computes the surfaces.
        settings_file: an INI file for recent files and theme instead of the user's own settings.
    """
    from PySide6.QtCore import QSettings

    from naisr_viewer.control.controller import Controller
    from naisr_viewer.control.desk import PatientDesk
    from naisr_viewer.control.worker import Worker
    from naisr_viewer.engine.clinic import Clinic
    from naisr_viewer.views.main_window import MainWindow

    if settings_file is None:
        settings = QSettings("naisr", "naisr-viewer")
    else:
        settings = QSettings(str(settings_file), QSettings.Format.IniFormat)
    window = MainWindow()
    controller = Controller(window, engine, Worker(), Worker(), settings)
    PatientDesk(window, controller, Clinic(engine))  # the controller owns it
    return window, controller


def make_application() -> QApplication:
    """The one application object, styled alike on every platform."""
    from PySide6.QtWidgets import QApplication

    app = QApplication.instance() or QApplication(["naisr-viewer"])
    assert isinstance(app, QApplication)
    app.setApplicationName("naisr-viewer")
    app.setStyle("Fusion")
    return app


def _attended(
    engine: Engine,
    path: Path,
    card: AtlasCard | None,
    values: Mapping[str, float],
    scan: Path | None,
    pixels: tuple[int, int],
) -> int:
    """The window in the hands of a person, until it is closed."""
    from PySide6.QtCore import Qt

    from naisr_viewer.program.display import has_display

    if not has_display():
        raise InputError("there is no display; use --screenshot, --demo or --measure, which need none")
    app = make_application()
    window, controller = make_window(engine)
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # so that Ctrl+C in the terminal ends the program
    if scan is not None:
        once = Qt.ConnectionType.SingleShotConnection
        controller.settled.connect(lambda: window.scan_requested.emit(scan), once)
    _show(window, controller, path, card, values, pixels)
    return app.exec()


def _show(
    window: MainWindow,
    controller: Controller,
    path: Path,
    card: AtlasCard | None,
    values: Mapping[str, float],
    pixels: tuple[int, int],
) -> None:
    """Put the window on the screen first; what takes long starts behind it."""

    def begin() -> None:
        window.shapes.prepare()
        if card is None:
            controller.open(path)
        else:
            controller.show_atlas(card, values)

    sys.excepthook = controller.report
    window.resize(*pixels)
    window.show_opening(path.name)
    window.appeared.connect(begin)
    window.show()


def _measured(engine: Engine, path: Path, pixels: tuple[int, int], file: Path) -> int:
    """The window as a person starts and drags it, with a stop-watch; leaves the user's settings alone."""
    from naisr_viewer.program.display import ensure_display

    before = time.monotonic()
    ensure_display(pixels)
    display_s = time.monotonic() - before  # whoever sits at a display does not wait for a virtual one
    make_application()
    with TemporaryDirectory(prefix="naisr-viewer-") as folder:
        window, controller = make_window(engine, Path(folder) / "settings.ini")
        from naisr_viewer.program.measure import Observer, measure, process_start

        observer = Observer(window, controller)
        _show(window, controller, path, None, {}, pixels)
        try:
            measure(window, controller, engine, observer, process_start(LOADED) + display_s, file)
        finally:
            window.close()
    print(f"wrote {file}")
    return 0


def _unattended(
    engine: Engine,
    card: AtlasCard,
    values: Mapping[str, float],
    scan: Path | None,
    pixels: tuple[int, int],
    screenshot: Path | None,
    demo: Path | None,
) -> int:
    """The same window without a person; leaves no trace in the user's settings."""
    from naisr_viewer.program import headless
    from naisr_viewer.program.display import ensure_display

    ensure_display(pixels)
    make_application()
    with TemporaryDirectory(prefix="naisr-viewer-") as folder:
        window, controller = make_window(engine, Path(folder) / "settings.ini")
        window.resize(*pixels)
        window.show()
        try:
            controller.show_atlas(card, values)
            if scan is not None:
                headless.finish(window, controller)
                window.scan_requested.emit(scan)
            if screenshot is not None:
                headless.take_screenshot(window, controller, screenshot)
            if demo is not None:
                headless.run_demo(window, controller, demo)
        finally:
            window.close()
    return 0
