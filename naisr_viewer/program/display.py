"""Whether there is a screen, and a virtual one where there is none. Knows no Qt.

Qt aborts the process where a display that is named does not answer, so it is asked first.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import socket
import subprocess
import sys
from pathlib import Path

from naisr_model.errors import InputError

PLATFORM = "QT_QPA_PLATFORM"
"""What a user says how Qt is to show windows, if anything."""

BLIND = frozenset({"offscreen", "minimal", "minimalegl"})
"""Platforms on which shapes cannot be drawn, or nothing can be seen."""

_connections: dict[str, int] = {}
"""By display, kept to the end of this process, however that comes: a server that loses its last one ends or
starts anew, and Qt would meet it in the middle of that."""


def has_display() -> bool:
    """Whether windows can be shown here: a display answers, and the user wants it."""
    if sys.platform in ("win32", "darwin"):
        return True
    wanted = os.environ.get(PLATFORM, "").partition(":")[0].split(";")[0]
    if wanted in BLIND:
        return False
    if wanted not in ("", "xcb", "wayland"):
        return True  # of which only Qt knows
    return wanted in _answering() if wanted else bool(_answering())


def require_display() -> None:
    """Make sure that a person can see the window, by what answers here.

    Raises:
        InputError: when nothing does.
    """
    if (wanted := os.environ.get(PLATFORM, "")).partition(":")[0] in BLIND:
        raise InputError(f"{PLATFORM} is '{wanted}', which shows no window; unset it")
    if not has_display():
        named = {name: os.environ[name] for name in ("DISPLAY", "WAYLAND_DISPLAY") if os.environ.get(name)}
        dead = " and ".join(f"{name}={value}" for name, value in named.items())
        why = f"the display does not answer ({dead})" if dead else "there is no display"
        raise InputError(f"{why}; use --screenshot, --demo or --measure, which need none")
    _take_what_answers()


def ensure_display(pixels: tuple[int, int]) -> None:
    """Where no display answers, make a virtual one of ``pixels`` for the rest of this process.

    The server ends by itself with the last connection to it, because a window system must not go
    away under a running application; one is held until this process ends.

    Raises:
        InputError: when there is no display and none can be made.
    """
    if has_display():
        _take_what_answers()
        return
    program = shutil.which("Xvfb")
    if program is None:
        raise InputError(
            "there is no display and Xvfb is not installed; install the package 'xvfb' and try again"
        )
    reading, writing = os.pipe()
    screen = f"{pixels[0]}x{pixels[1]}x24"
    command = [program, "-displayfd", str(writing), "-terminate", "-screen", "0", screen, "-nolisten", "tcp"]
    quiet = subprocess.DEVNULL
    # In a session of its own, where the Ctrl+C of a terminal does not reach it before us.
    server = subprocess.Popen(
        command, pass_fds=[writing], stdin=quiet, stdout=quiet, stderr=quiet, start_new_session=True
    )
    os.close(writing)
    with os.fdopen(reading) as pipe:
        number = pipe.readline().strip()
    if not number or not _is_connected(f":{number}"):
        server.kill()
        raise InputError("the virtual display (Xvfb) did not start; run Xvfb by hand to see why")
    os.environ["DISPLAY"], os.environ[PLATFORM] = f":{number}", "xcb"


def _answering() -> list[str]:
    """Qt's names of the window systems that are named in the environment and answer."""
    answering = []
    if _is_wayland_there():
        answering.append("wayland")
    if os.environ.get("DISPLAY") and _is_connected(os.environ["DISPLAY"]):
        answering.append("xcb")
    return answering


def _take_what_answers() -> None:
    """Keep Qt from trying what does not; where both answer, the choice is Qt's."""
    if sys.platform not in ("win32", "darwin") and len(answering := _answering()) == 1:
        os.environ.setdefault(PLATFORM, answering[0])


def _is_wayland_there() -> bool:
    name = os.environ.get("WAYLAND_DISPLAY")
    if not name:
        return False
    place = Path(os.environ.get("XDG_RUNTIME_DIR", "/"), name)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
        try:
            connection.connect(str(place))
        except OSError:
            return False
    return True


def _is_connected(display: str) -> bool:
    """Whether an X server answers; not where the library is missing that Qt asks by."""
    if display in _connections:
        return True
    try:
        xcb = _xcb()
    except OSError:
        return False
    connection = xcb.xcb_connect(display.encode(), None)
    if xcb.xcb_connection_has_error(connection):
        xcb.xcb_disconnect(connection)
        return False
    _connections[display] = connection
    return True


def _xcb() -> ctypes.CDLL:
    xcb = ctypes.CDLL("libxcb.so.1")
    xcb.xcb_connect.restype = ctypes.c_void_p
    xcb.xcb_connect.argtypes = [ctypes.c_char_p, ctypes.c_void_p]
    xcb.xcb_connection_has_error.argtypes = xcb.xcb_disconnect.argtypes = [ctypes.c_void_p]
    return xcb
