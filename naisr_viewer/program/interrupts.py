"""Ctrl+C in the terminal ends the program, whatever Qt is at."""

from __future__ import annotations

import signal
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from PySide6.QtCore import QSocketNotifier

from naisr_model.terminal import leave


@contextmanager
def ending_at_once(tidy: Callable[[], object] = lambda: None) -> Iterator[None]:
    """Ctrl+C tidies up and ends the process; an exception would be lost in Qt.

    Python looks after signals only while it runs, and a window at rest runs none of it; so a signal is
    written to a socket, which Qt watches.
    """

    def end(_number: int, _frame: object) -> None:
        tidy()
        leave("naisr-viewer")

    reading, writing = socket.socketpair()
    writing.setblocking(False)
    with reading, writing:
        watch = QSocketNotifier(reading.fileno(), QSocketNotifier.Type.Read)
        watch.activated.connect(lambda: reading.recv(64))
        handler, wakeup = signal.signal(signal.SIGINT, end), signal.set_wakeup_fd(writing.fileno())
        try:
            yield
        finally:
            signal.set_wakeup_fd(wakeup)
            signal.signal(signal.SIGINT, handler)
            watch.setEnabled(False)
