"""What a program owes whoever started it: it ends at Ctrl+C, and its words are never what it fails at."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import NoReturn

from naisr_model.errors import Cancelled, InputError

REFUSED, STOPPED = 2, 130
"""Exit codes: input that cannot be used, and Ctrl+C."""


def run(program: str, work: Callable[[], int], *, is_all: bool) -> int:
    """What a program does, with its faults told in a sentence each.

    Ctrl+C ends it with one sentence, whatever a library makes of the :class:`KeyboardInterrupt`. While one is
    loaded the program ends at once, because it may take that for a fault of its own, or for none; so it does
    at a second Ctrl+C, which does not wait for a clean end.

    Args:
        program: its name, with which sentences begin.
        work: gives the exit code.
        is_all: whether the process ends with it, so that Ctrl+C has nothing left to stop.

    Returns:
        The exit code: 2 for input that cannot be used, 130 when stopped.
    """
    came = False

    def interrupt(_number: int, frame: FrameType | None) -> None:
        nonlocal came
        if came or _is_loading(frame):
            leave(program)
        came = True
        raise KeyboardInterrupt

    _open_streams()
    previous = signal.signal(signal.SIGINT, interrupt)
    try:
        return _judged(program, work)
    except BaseException as error:
        if not came and not isinstance(error, KeyboardInterrupt | Cancelled):
            raise
        say(_stopped(program))
        return STOPPED
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN if is_all else previous)


@contextmanager
def loading(program: str) -> Iterator[None]:
    """Ctrl+C ends a program at once while it loads its own modules, unless it runs in another one."""
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    with suppress(ValueError):  # in another thread
        signal.signal(signal.SIGINT, lambda *_: leave(program))
    try:
        yield
    finally:
        with suppress(ValueError):
            signal.signal(signal.SIGINT, signal.default_int_handler)


def leave(program: str) -> NoReturn:
    """End a program that was stopped, at once: nobody can swallow that."""
    with suppress(OSError, ValueError):
        sys.stdout.flush()
    say(_stopped(program))
    os._exit(STOPPED)


def say(sentence: str) -> None:
    """Tell a sentence beside the results; nothing fails where nobody listens."""
    with suppress(OSError, ValueError):
        print(sentence, file=sys.stderr, flush=True)


def _stopped(program: str) -> str:
    return f"{program}: stopped; what was finished is kept"


def _is_loading(frame: FrameType | None) -> bool:
    while frame is not None and "importlib._bootstrap" not in frame.f_code.co_filename:
        frame = frame.f_back
    return frame is not None


def _judged(program: str, work: Callable[[], int]) -> int:
    try:
        code = work()
        if sys.stdout is not None:
            sys.stdout.flush()
        return code
    except InputError as error:
        for note in getattr(error, "__notes__", ()):
            say(note)
        say(f"{program}: {error}")
    except MemoryError:
        say(f"{program}: this machine's memory does not suffice; ask for less, as a lower resolution")
    except BrokenPipeError:  # nobody reads on; results are in files before they are told
        _close_output()
        return 0
    except OSError as error:
        if error.filename is None:
            _close_output()
        what = "what it tells cannot be written" if error.filename is None else error.filename
        say(f"{program}: {what}: {error.strerror or error}")
    return REFUSED


def _open_streams() -> None:
    """Words that a stream has no letters for are told with others; files are never opened as a stream."""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")


def _close_output() -> None:
    """Forget what could not be told, or Python tries again when it ends."""
    with suppress(OSError, ValueError, AttributeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
