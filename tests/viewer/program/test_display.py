"""Displays that are dead, blind, missing, or cannot draw; each in a program of its own."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest
from PySide6.QtGui import QImage

from naisr_model.errors import InputError
from naisr_viewer.engine.engine import Engine
from naisr_viewer.program import display

ROOT = Path(__file__).parents[3]
DEAD = ":31917"
NAMES = ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM")

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or shutil.which("Xvfb") is None, reason="needs a virtual display"
)


@pytest.fixture
def named(monkeypatch):
    """Sets the environment that names a display."""

    def name(**values: str) -> None:
        for variable in NAMES:
            monkeypatch.delenv(variable, raising=False)
        for variable, value in values.items():
            monkeypatch.setenv(variable, value)

    return name


def run(code: str, **named: str) -> subprocess.CompletedProcess[str]:
    """Run ``code`` in a process of its own that knows of no other display."""
    environment = {name: value for name, value in os.environ.items() if name not in NAMES} | named
    return subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )


def viewer(*words: object) -> str:
    return f"import sys; from naisr_viewer.app import main; sys.exit(main({[str(word) for word in words]!r}))"


@pytest.mark.parametrize(
    ("environment", "told"),
    [
        ({}, "there is no display; use --screenshot"),
        ({"DISPLAY": DEAD}, rf"the display does not answer \(DISPLAY={DEAD}\); use --screenshot"),
        ({"WAYLAND_DISPLAY": "none"}, r"does not answer \(WAYLAND_DISPLAY=none\)"),
        ({"DISPLAY": DEAD, "WAYLAND_DISPLAY": "none"}, f"DISPLAY={DEAD} and WAYLAND_DISPLAY=none"),
        ({"DISPLAY": DEAD, "QT_QPA_PLATFORM": "xcb"}, "does not answer"),
        ({"QT_QPA_PLATFORM": "offscreen"}, "QT_QPA_PLATFORM is 'offscreen', which shows no window; unset it"),
        ({"QT_QPA_PLATFORM": "minimal:x"}, "'minimal:x', which shows no window"),
    ],
)
def test_a_display_that_cannot_be_had_is_a_sentence(named, environment, told):
    named(**environment)
    assert not display.has_display()
    with pytest.raises(InputError, match=told):
        display.require_display()


def test_a_display_that_answers_is_used_beside_one_that_does_not(named):
    there = os.environ["DISPLAY"]
    named(DISPLAY=there, WAYLAND_DISPLAY="none")
    assert display.has_display()
    display.require_display()
    assert os.environ["QT_QPA_PLATFORM"] == "xcb"
    named(DISPLAY=there, QT_QPA_PLATFORM="offscreen")
    assert not display.has_display()


@pytest.mark.parametrize("end", ["", "os.kill(os.getpid(), signal.SIGKILL)", "os._exit(3)"])
def test_a_virtual_display_goes_with_the_program_that_made_it(end):
    done = run(
        f"""
        import os, signal
        from naisr_viewer.program.display import ensure_display
        ensure_display((640, 480))
        print(os.environ["DISPLAY"], flush=True)
        {end}
        """
    )
    socket = Path(f"/tmp/.X11-unix/X{done.stdout.strip().removeprefix(':')}")
    deadline = time.monotonic() + 120
    while socket.exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not socket.exists()


@pytest.mark.parametrize(
    ("variable", "value", "offered"),
    [("MESA_GL_VERSION_OVERRIDE", "2.1", "OpenGL 2.1"), ("QT_XCB_GL_INTEGRATION", "none", "no OpenGL")],
)
def test_a_display_that_cannot_draw_is_a_sentence(egg_atlas, tmp_path, variable, value, offered):
    done = run(viewer(egg_atlas, "--screenshot", tmp_path / "x.png"), **{variable: value})
    assert done.returncode == 2, done.stderr
    assert f"this display (xcb) offers {offered}, and shapes are drawn with 3.2 or newer" in done.stderr
    assert done.stdout == "" and not (tmp_path / "x.png").exists()


def test_pictures_need_no_display_that_answers_and_qt_is_imported_by_one_thread(egg_atlas, tmp_path):
    """The program died now and then where a thread imported what touches Qt beside a running window."""
    done = run(
        f"""
        import sys, threading
        QT = {{"PySide6", "shiboken6", "qtpy", "pyvistaqt", "pyqtgraph", "PyQt5", "PyQt6", "PySide2"}}
        beside = []

        class Watch:
            def find_spec(self, name, path=None, target=None):
                ours = name.startswith(("naisr_viewer.views", "naisr_viewer.control", "naisr_viewer.program"))
                is_qt = name.partition(".")[0] in QT or ours
                if is_qt and threading.current_thread() is not threading.main_thread():
                    beside.append(name)

        sys.meta_path.insert(0, Watch())
        from naisr_viewer.app import main
        code = main([{str(egg_atlas)!r}, "--screenshot", {str(tmp_path / "x.png")!r}, "--size", "800x600"])
        print("code", code, "beside", beside)
        """,
        DISPLAY=DEAD,
        WAYLAND_DISPLAY="none",
        QT_QPA_PLATFORM="minimal",
        XDG_CACHE_HOME=str(tmp_path / "cache"),
    )
    assert "code 0 beside []" in done.stdout, done.stderr
    assert not QImage(str(tmp_path / "x.png")).isNull()


@pytest.mark.parametrize("moment", ["shown", "at rest"])
def test_ctrl_c_ends_a_window_with_one_sentence(egg_atlas, moment):
    """At rest no Python runs that could look after a signal."""
    wait_s = 0.0 if moment == "shown" else 3.0
    done = run(
        f"""
        import os, signal, sys, threading
        from naisr_viewer.app import main
        from naisr_viewer.program import start

        def show(window, *given):
            end = threading.Timer({wait_s}, os.kill, (os.getpid(), signal.SIGINT))
            window.appeared.connect(lambda: end.start())
            shown(window, *given)

        shown, start.show = start.show, show
        sys.exit(main([{str(egg_atlas)!r}]))
        """,
        DISPLAY=os.environ["DISPLAY"],
    )
    assert done.returncode == 130
    assert done.stderr == "naisr-viewer: stopped; what was finished is kept\n"


def test_a_place_that_will_not_do_is_refused_before_the_work(egg_atlas, tmp_path):
    (tmp_path / "file").write_text("precious")
    for words, told in (
        (("--screenshot", tmp_path), "is a folder; give the name of a file"),
        (("--screenshot", "/dev/null"), "is a device or a pipe"),
        (("--measure", tmp_path / "file" / "m.json"), "is a file, no folder"),
        (("--demo", tmp_path / "file"), "--demo writes into a folder"),
    ):
        done = run(viewer(egg_atlas, *words))
        assert done.returncode == 2 and told in done.stderr and done.stderr.count("\n") == 1
    assert os.listdir(tmp_path) == ["file"] and (tmp_path / "file").read_text() == "precious"


def test_a_device_that_is_missing_is_told_although_the_first_picture_was_kept(egg_atlas, tmp_path):
    picture = tmp_path / "x.png"
    code = viewer(egg_atlas, "--device", "typewriter", "--screenshot", picture)
    first = Engine(folder=tmp_path / "cache" / "naisr-viewer")
    first.open(egg_atlas)
    first.prepare_previews(egg_atlas)
    done = run(code, XDG_CACHE_HOME=str(tmp_path / "cache"))
    assert done.returncode == 2 and "torch cannot compute on 'typewriter'" in done.stderr
    assert not picture.exists()


@pytest.mark.skipif(not hasattr(signal, "SIGXFSZ"), reason="there is no limit for files")
@pytest.mark.parametrize("room", [2_000, 10_000_000])
def test_a_picture_is_told_only_where_it_is(egg_atlas, tmp_path, room):
    """A limit for the size of files stands for a full disk."""
    picture = tmp_path / "x.png"
    limit = (
        "import resource; from naisr_viewer.program import display; display.ensure_display((1280, 800))\n"
        f"resource.setrlimit(resource.RLIMIT_FSIZE, ({room}, {room}))\n"
    )
    done = run(limit + viewer(egg_atlas, "--screenshot", picture), XDG_CACHE_HOME=str(tmp_path / "cache"))
    if room > 100_000:
        assert done.returncode == 0 and done.stdout == f"wrote {picture}\n", done.stderr
        assert not QImage(str(picture)).isNull()
    else:
        assert done.returncode == 2 and "File too large" in done.stderr and str(picture) in done.stderr
        assert done.stdout == "" and set(os.listdir(tmp_path)) <= {"cache"}
