"""The same inputs opened in a real window."""

from __future__ import annotations

import gc
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from corpus import checkpoints, clouds, meshes, volumes
from corpus.case import Case, Expected
from corpus.child import Job

if TYPE_CHECKING:
    from naisr_viewer.control.controller import Controller
    from naisr_viewer.views.main_window import MainWindow

SECONDS = 50.0


def opened(job: Job) -> int:
    """Open the file of a job in a window: 0 when it is shown, 2 when a message is, as a command would end.

    Raises:
        RuntimeError: when neither is.
    """
    from naisr_viewer.program.display import ensure_display

    ensure_display((1280, 800))
    message, is_shown = _seen(job)
    _bury()
    return _told(message, is_shown)


def _seen(job: Job) -> tuple[str, bool]:
    """The message in the window, and whether the file is shown."""
    from naisr_viewer.program.start import make_engine, own_window

    path = job.folder / job.words[0]
    with own_window(make_engine("cpu")) as (window, controller), _dialogs_declined() as asked:
        window.resize(1280, 800)
        window.show()
        controller.open(job.atlas)
        _rest(window, controller)
        if window.error_text.text():
            raise RuntimeError(f"the atlas does not open: {window.error_text.text()}")
        if job.program == "atlas":
            controller.open(path)
        else:
            (window.scan_requested if job.program == "scan" else window.session_requested).emit(path)
        _rest(window, controller)
        atlas = controller.state.atlas
        is_shown = bool(controller.state.patients) or (atlas is not None and atlas.path != job.atlas)
        window.deleteLater()
        return window.error_text.text() or "; ".join(asked), is_shown


def _bury() -> None:
    """Delete the window here and now: a later look for garbage may come in a thread that Qt is not in."""
    from PySide6.QtCore import QCoreApplication, QEvent

    gc.collect()
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)
    gc.collect()


def _told(message: str, is_shown: bool) -> int:
    if not message and not is_shown:
        raise RuntimeError("neither the file nor a message is shown")
    if message:
        print(f"naisr-viewer: {message}".replace("\n", " "), file=sys.stderr)
    return 0 if is_shown else 2


def _rest(window: MainWindow, controller: Controller) -> None:
    """Run the window until nothing is computed any more.

    Raises:
        RuntimeError: when it does not come to rest.
    """
    from PySide6.QtWidgets import QApplication

    end, still = time.monotonic() + SECONDS, 0
    while still < 5:
        QApplication.processEvents()
        time.sleep(0.005)
        is_still = window.shapes.is_ready and not controller.is_busy
        still = still + 1 if is_still else 0
        if time.monotonic() > end:
            raise RuntimeError("the window does not come to rest")


@contextmanager
def _dialogs_declined() -> Iterator[list[str]]:
    """Nobody sits here: whatever asks is closed; its titles are collected."""
    from PySide6.QtCore import QTimer
    from PySide6.QtWidgets import QApplication, QDialog

    asked: list[str] = []

    def decline() -> None:
        dialog = QApplication.activeModalWidget()
        if isinstance(dialog, QDialog):
            asked.append(f"it asks: {dialog.windowTitle() or type(dialog).__name__}")
            dialog.reject()

    timer = QTimer()
    timer.timeout.connect(decline)
    timer.start(100)
    try:
        yield asked
    finally:
        timer.stop()


SCANS = (
    *(
        f"mesh-{name}"
        for name in (
            *(
                "binary_stl",
                "binary_glb",
                "stl_cut_at_0.35",
                "vtk_cut_at_0.6",
                "vtp_cut_at_0.6",
                "glb_cut_at_0.35",
            ),
            *(
                "text_vtk:_POINTS_2000000000_announced",
                "ply:_face_99999999999_announced",
                "vtp:_lines",
                "glb:_Draco",
            ),
            *(
                "shape:_not_a_number",
                "shape:_1e300",
                "shape:_in_inches",
                "shape:_far_away",
                "shape:_debris_far_away",
            ),
            *(
                "a_web_page_named_.stl",
                "zeros_named_.vtp",
                "a_folder_named_egg.stl",
                "a_pipe_named_egg.ply",
                "a_loop_named_egg.obj",
            ),
            *(
                "stl_with_500_flips_a",
                "vtk_with_500_flips_a",
                "vtp_with_500_flips_a",
                "ply_with_500_flips_a",
                "shape:_the_upper_third",
            ),
        )
    ),
    *(
        f"volume-{name}"
        for name in (
            *(
                "nii_as_it_is",
                "nii:_two_labels",
                "nii.gz_cut_at_0.55",
                "nrrd_cut_at_0.55",
                "nii:_a_scan",
                "nii:_1500_labels",
            ),
            *(
                "nii:_dimensions_(3,_30000,_30000,_30000)",
                "nrrd:_spacings_nan",
                "slicer:_layers",
                "a_zip_named_.nii.gz",
            ),
        )
    ),
    *(f"cloud-{name}" for name in ("commas,_csv", "two_numbers", "nan", "a_zip", "ten_points")),
)
"""Of the other kinds, what a window is shown as well."""

ATLASES = (
    *(
        f"checkpoint-{name}"
        for name in (
            *(
                "as_it_is,_info",
                "cut_at_0.5",
                "a_mesh",
                "a_zip",
                "a_table",
                "tensor_0:_nan,_mesh",
                "header:_version_abc",
            ),
            *(
                "record:_a_scale_of_0",
                "record:_a_scale_of_nan",
                "record:_1000000000_wide",
                "record:_short_values",
            ),
            *(
                "record:_a_covariate_of_scale_0",
                "record:_everybody_held_out",
                "record:_no_covariates",
                "a_folder,_info",
            ),
        )
    ),
)


FOR_A_PERSON = ("mesh-shape:_far_away", "mesh-shape:_in_inches")
"""What a command refuses and a window shows, because a person can align it and choose the unit there."""


def _shown(case: Case, program: str) -> Case:
    """The files of a case in the window instead of under a command."""
    file = case.words[1] if program == "scan" else checkpoints.FILE
    ending = Expected("either" if case.id in FOR_A_PERSON else case.expected.ending)
    return Case("window", case.id, case.make, (file,), ending, program)


def _chosen() -> Iterator[Case]:
    known = {case.id: case for case in (*meshes.CASES, *volumes.CASES, *clouds.CASES, *checkpoints.CASES)}
    yield from (_shown(known[name], "scan") for name in SCANS)
    yield from (_shown(known[name], "atlas") for name in ATLASES)


CASES = tuple(_chosen())
