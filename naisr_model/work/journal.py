"""What a run has measured so far, one line of JSON a case, so that a run that was killed goes on.

The first line says of what the journal is; every other one is a case. A line counts once it is complete, so
the half of one that a killed run leaves is forgotten, and its case is measured again. One run keeps a journal
at a time: it holds the file of the same name with ``.lock`` behind it, which goes with the run.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from io import FileIO
from pathlib import Path
from typing import Any

from naisr_model import records
from naisr_model.errors import InputError
from naisr_model.files import checked_place, flush, telling
from naisr_model.work.alone import alone

Record = dict[str, Any]
"""Plain JSON types by name."""

Keep = Callable[[str, Record], None]


def plain(record: Mapping[str, Any]) -> Record:
    """A record as it comes back from a journal, whether it was in one or not."""
    return json.loads(json.dumps(record))


def read(path: Path, identity: Record) -> dict[str, Record]:
    """The records that a journal keeps, by key; none where there is no journal yet.

    Args:
        path: the journal.
        identity: what it must be of, see :func:`keeping`.

    Raises:
        InputError: when it is of something else, or no journal.
    """
    first, *cases = [_parsed(path, line) for line in _complete_lines(path, identity)] or [identity]
    if first != identity:
        raise InputError(f"{path} keeps {_other(first, identity)}; name another journal, or delete this one")
    if not all(isinstance(case.get("key"), str) and isinstance(case.get("record"), dict) for case in cases):
        raise _no_journal(path)
    return {case["key"]: case["record"] for case in cases}


@contextmanager
def keeping(path: Path, identity: Record) -> Iterator[tuple[dict[str, Record], Keep]]:
    """Hands out what :func:`read` gives, and what adds a record under a key; nobody else can meanwhile.

    Args:
        path: the journal; made where there is none.
        identity: of what it is: its first line.

    Raises:
        InputError: when it is of something else, no journal, kept by another run, or cannot be written.
    """
    told = f"another run keeps {path}; wait until it has ended, or name another journal"
    target = checked_place(path)
    with alone(target.with_name(f"{target.name}.lock"), told):
        records, whole = read(path, identity), _complete_lines(path, identity)
        with _opened(path) as file:
            with telling(path):
                file.truncate(sum(map(len, whole)))
            if not whole:
                _add(path, file, identity)
            yield records, lambda key, record: _add(path, file, {"key": key, "record": record})


def _opened(path: Path) -> FileIO:
    with telling(path):
        return path.open("ab", buffering=0)


def _add(path: Path, file: FileIO, value: Record) -> None:
    """Add a line, and wait until it is on the disk."""
    left = memoryview(_line(value))
    with telling(path):
        while left:  # a disk that is nearly full takes a part
            left = left[file.write(left) :]
        flush(file.fileno())


def _line(value: Record) -> bytes:
    return json.dumps(value).encode() + b"\n"


def _complete_lines(path: Path, identity: Record) -> list[bytes]:
    """The lines of a journal with their ends; none where a run was killed before the first was written."""
    content = path.read_bytes() if path.exists() else b""
    lines = content.splitlines(keepends=True)
    whole = [line for line in lines if line.endswith(b"\n")]
    if lines and not whole and not _line(identity).startswith(content):
        raise _no_journal(path)
    return whole


def _parsed(path: Path, line: bytes) -> Record:
    try:
        return records.parsed(line.decode())
    except ValueError as error:
        raise _no_journal(path) from error


def _no_journal(path: Path) -> InputError:
    return InputError(f"{path} is no journal; name another file")


def _other(found: Record, expected: Record) -> str:
    """What a journal is of, where that is not what was expected."""
    if found.keys() != expected.keys():
        return "something else"
    names = [name for name in expected if found[name] != expected[name]]
    return f"a run with another {' and another '.join(names)}"
