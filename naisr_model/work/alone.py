"""One run at a time on one output: a second is told instead of mixing its files with those of the first."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from naisr_model.errors import InputError
from naisr_model.files import telling

CANNOT_LOCK = frozenset({errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP, errno.EINVAL})
"""What file systems without locks say; there nobody is kept out."""


@contextmanager
def alone(lock: Path, told: str) -> Iterator[None]:
    """Hold a file as long as the work on an output takes; a killed run lets go of it.

    Args:
        lock: the file; made with its folder, and gone at the end.
        told: what whoever comes second is told.

    Raises:
        InputError: when another run holds it, or it cannot be made.
    """
    held = FileLock(lock)
    with telling(lock):
        lock.parent.mkdir(parents=True, exist_ok=True)
        try:
            held.acquire(blocking=False)
        except Timeout as error:
            raise InputError(told) from error
        except OSError as error:
            if error.errno not in CANNOT_LOCK:
                raise
    try:
        yield
    finally:
        with suppress(OSError):  # while it is held, so that nobody else's is removed
            lock.unlink()
        held.release()
