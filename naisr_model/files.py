"""Files: written so that a reader, or a power cut, never meets half of one, and known by their contents.

Whatever keeps a file from being written ends here, in a sentence that names it; nothing half written is left.
"""

from __future__ import annotations

import errno
import hashlib
import os
import secrets
import shutil
import stat
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from naisr_model.errors import InputError

ABANDONED_S = 3600.0
"""A half-written file that has not grown for so long is of a run that was killed."""

LOST = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO})
"""What says that the content is not on the disk; another refusal to wait for it says nothing of that."""

FULL = frozenset({errno.ENOSPC, errno.EDQUOT})


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path with the same suffix that takes the place of ``path`` on success.

    On an exception the temporary file is removed, with the folders that were made for it, and what stood at
    ``path`` stays as it was. A link is followed. What is written in between says by an :class:`OSError` that
    it could not be; a writer that says it in another way writes into memory first.

    Raises:
        InputError: for a path that is no place for a file, or when the file cannot be written.
    """
    target = checked_place(path)
    temporary = target.with_name(f".{target.stem}.{secrets.token_hex(4)}{target.suffix}")
    new_folders = [folder for folder in target.parents if not folder.exists()]
    with telling(path):
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            temporary.touch()
            _forget_abandoned(target, temporary.stat().st_mtime - ABANDONED_S)
            yield temporary
            with temporary.open("rb+") as file:  # a rename may otherwise get to the disk before the content
                flush(file.fileno())
            _open_to_others(temporary)
            os.replace(temporary, target)
        except BaseException:
            temporary.unlink(missing_ok=True)
            with suppress(OSError):  # others may have put something there
                for folder in new_folders:
                    folder.rmdir()
            raise


def write_all(files: Iterable[tuple[Path, bytes]]) -> None:
    """Write files that belong together: all take their places in the end, or none does.

    Args:
        files: places and contents, asked for one after the other: only one content need be in memory.

    Raises:
        InputError: when one of them cannot be written.
    """
    with ExitStack() as together:
        for path, content in files:
            together.enter_context(replacing(path)).write_bytes(content)


@contextmanager
def replacing_folder(path: Path) -> Iterator[Path]:
    """The same for a folder of files: yield an empty one that takes the place of ``path`` on success.

    Raises:
        InputError: when it cannot be written.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    shutil.rmtree(temporary, ignore_errors=True)
    with telling(path):
        try:
            temporary.mkdir()
            yield temporary
            shutil.rmtree(path, ignore_errors=True)
            temporary.rename(path)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)


def checked_place(path: Path) -> Path:
    """Where a file that is to be written will be, links followed; asked before the work that it is to hold.

    Raises:
        InputError: for a folder, a device or a pipe, and where the folder around it cannot be written to.
    """
    if not path.name or path.is_dir():
        raise InputError(f"'{path}' is a folder; give the name of a file to write")
    if path.exists() and not path.is_file():
        raise InputError(f"'{path}' is a device or a pipe; give the name of a file to write")
    target = Path(os.path.realpath(path))
    around = next(folder for folder in target.parents if folder.exists())
    if not around.is_dir():
        raise InputError(f"cannot write {path}: {around} is a file, no folder; choose another folder")
    if not os.access(around, os.W_OK | os.X_OK):
        raise InputError(f"cannot write {path}: {around} cannot be written to; choose another folder")
    return target


def forget_unfinished(path: Path) -> None:
    """Remove what killed runs left of ``path``; for whoever alone writes it."""
    _forget_abandoned(path, float("inf"))


@contextmanager
def telling(path: Path) -> Iterator[None]:
    """Says in a sentence why ``path`` could not be written.

    Raises:
        InputError: in the place of an :class:`OSError`.
    """
    try:
        yield
    except OSError as error:
        remedy = "free some space and run again" if error.errno in FULL else "choose another folder"
        raise InputError(f"cannot write {path}: {error.strerror or error}; {remedy}") from error


def flush(descriptor: int) -> None:
    """Wait until what was written is on the disk.

    Some file systems cannot wait; the content is as safe there as it gets.

    Raises:
        OSError: when it did not get there.
    """
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno in LOST:
            raise


_SPECIAL = {
    stat.S_ISDIR: ("is a folder", "give a file in it"),
    stat.S_ISFIFO: ("is a pipe", "write its content into a file first"),
    stat.S_ISSOCK: ("is a socket", "give a file"),
    stat.S_ISCHR: ("is a device", "give a file"),
    stat.S_ISBLK: ("is a device", "give a file"),
}


def require_file(path: str | Path, kind: str = "") -> Path:
    """The path of a file that is there and has content.

    Args:
        path: of the file.
        kind: what it should be, as ``an atlas (.safetensors)``.

    Raises:
        InputError: when nothing is there, or a folder, a pipe, a link to nowhere or to itself, an empty file,
            or what may not be looked at.
    """
    path = Path(path)
    try:
        state = path.stat()
    except (OSError, ValueError) as error:
        raise InputError(why_unreadable(path, error, kind)) from error
    for applies, (what, remedy) in _SPECIAL.items():
        if applies(state.st_mode):
            raise InputError(f"{path} {what}; {_give(kind) or remedy}")
    if not state.st_size:
        raise InputError(f"{path.name} is empty (0 bytes); copy or export it again")
    return path


def why_unreadable(path: Path, error: OSError | ValueError, kind: str = "") -> str:
    """What keeps a file from being read, and what to do, in a sentence."""
    if not isinstance(error, OSError):
        return f"{str(path)!r} is no path ({error}); correct it"
    if error.errno == errno.ELOOP:
        return f"{path} is a link that leads back to itself; give the file that is meant"
    if error.errno == errno.ENOENT and path.is_symlink():
        return f"{path} is a link to {path.readlink()}, which does not exist; give the file that is meant"
    if error.errno == errno.ENOENT:
        return f"{path} does not exist; {_give(kind) or 'correct the path'}"
    if error.errno == errno.ENOTDIR:
        return f"{path} does not exist, since a part of it is a file and no folder; correct the path"
    if error.errno in (errno.EACCES, errno.EPERM):
        return f"{path} may not be read by you; change its permissions or copy it"
    return f"{path} cannot be read ({error.strerror or error}); correct the path or copy the file"


def _give(kind: str) -> str:
    return f"give the path of {kind}" if kind else ""


Stamp = tuple[int, int] | None
"""When a file was written (ns) and its size; None where there is none."""


def stamp_of(path: Path) -> Stamp:
    """What changes when a file is written."""
    try:
        facts = path.stat()
    except OSError:
        return None
    return facts.st_mtime_ns, facts.st_size


def sha256_of(path: Path, kind: str = "") -> str:
    """Of a file's content, hexadecimal; read piece by piece, however large it is.

    Raises:
        InputError: when it cannot be read; it says that it should be ``kind``.
    """
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise InputError(why_unreadable(path, error, kind)) from error


def sources_digest(*folders: Path) -> bytes:
    """SHA-256 of the Python sources in some folders: another one is another program, whatever its version."""
    sources = [file for folder in folders for file in sorted(folder.rglob("*.py"))]
    return hashlib.sha256(b"".join(file.read_bytes() for file in sources)).digest()


def _forget_abandoned(path: Path, before: float) -> None:
    """Remove half-written files of ``path`` last changed before then, in seconds of the epoch."""
    start, length = f".{path.stem}.", len(path.stem) + len(path.suffix) + 10
    with suppress(OSError), os.scandir(path.parent) as entries:
        for entry in entries:
            is_ours = entry.name.startswith(start) and entry.name.endswith(path.suffix)
            if is_ours and len(entry.name) == length and entry.stat().st_mtime < before:
                Path(entry.path).unlink(missing_ok=True)


def _open_to_others(path: Path) -> None:
    """Some writers make private files; a saved file is as readable as any other, where permissions exist."""
    with suppress(OSError):
        path.chmod(0o666 & ~_UMASK)


def _read_umask() -> int:
    """Asking means setting, for the whole process; hence only once, before there are threads."""
    mask = os.umask(0o077)
    os.umask(mask)
    return mask


_UMASK = _read_umask()
