"""Files: written so that a reader, or a power cut, never meets half of one, and known by their contents."""

from __future__ import annotations

import hashlib
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from naisr_model.errors import InputError


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path with the same suffix that takes the place of ``path`` on success.

    On an exception the temporary file is removed and what stood at ``path`` stays as it was.

    Raises:
        InputError: for a path that is a folder's by its name (``.``, ``/``).
    """
    if not path.name:
        raise InputError(f"'{path}' is a folder; give the name of a file to write")
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}.{secrets.token_hex(4)}{path.suffix}")
    try:
        yield temporary
        _flush(temporary)
        # Some writers make private files; a saved file is as readable as any other.
        temporary.chmod(0o666 & ~_UMASK)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


Stamp = tuple[int, int] | None
"""When a file was written (ns) and its size; None where there is none."""


def stamp_of(path: Path) -> Stamp:
    """What changes when a file is written."""
    try:
        facts = path.stat()
    except OSError:
        return None
    return facts.st_mtime_ns, facts.st_size


def sources_digest(*folders: Path) -> bytes:
    """SHA-256 of the Python sources in some folders: another one is another program, whatever its version."""
    sources = [file for folder in folders for file in sorted(folder.rglob("*.py"))]
    return hashlib.sha256(b"".join(file.read_bytes() for file in sources)).digest()


def _flush(path: Path) -> None:
    """Wait until the content is on the disk: a rename may otherwise get there first."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def _read_umask() -> int:
    """Asking means setting, for the whole process; hence only once, before there are threads."""
    mask = os.umask(0o077)
    os.umask(mask)
    return mask


_UMASK = _read_umask()
