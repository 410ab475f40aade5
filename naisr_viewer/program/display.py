"""Whether there is a screen, and a virtual one where there is none. Knows no Qt."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

from naisr_model.errors import InputError


def has_display() -> bool:
    """Whether windows can be shown here."""
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def ensure_display(pixels: tuple[int, int]) -> None:
    """Where there is no display, make a virtual one of ``pixels`` for the rest of this process.

    The server ends by itself with the last connection to it, because a window system must not go
    away under a running application.

    Raises:
        InputError: when there is no display and none can be made.
    """
    if has_display():
        return
    program = shutil.which("Xvfb")
    if program is None:
        raise InputError(
            "there is no display and Xvfb is not installed; install the package 'xvfb' and try again"
        )
    reading, writing = os.pipe()
    screen = f"{pixels[0]}x{pixels[1]}x24"
    command = [program, "-displayfd", str(writing), "-terminate", "-screen", "0", screen, "-nolisten", "tcp"]
    subprocess.Popen(command, pass_fds=[writing], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        number = pipe.readline().strip()
    if not number:
        raise InputError("the virtual display (Xvfb) did not start; run Xvfb by hand to see why")
    os.environ["DISPLAY"] = f":{number}"
