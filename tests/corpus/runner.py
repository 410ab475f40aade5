"""Runs cases in child processes, one a core, and outlives whatever becomes of them."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import threading
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from corpus.case import Case, Goods, place
from corpus.child import Job, Report, serve

MOST_SECONDS = 60.0
MOST_MB = 4000.0
_LOOK_S = 0.05


@dataclass(frozen=True)
class Outcome:
    """What became of a case.

    Attributes:
        case: the case.
        folder: where it was run.
        report: the process's own; None where it did not live to tell.
        death: how it ended then.
        before: the files of its folder that were there before.
        after: the files of its folder afterwards, folders for themselves left out.
        scratch: what lies in the folder for temporary files.
        err: standard error of a process that did not live.
    """

    case: Case
    folder: Path
    report: Report | None
    death: str
    before: Mapping[str, bytes]
    after: Mapping[str, bytes]
    scratch: tuple[str, ...]
    err: str = ""


class Runner:
    """Runs cases.

    Args:
        goods: what the cases are made from.
        folder: for all that is written.
        children: how many processes.
    """

    def __init__(self, goods: Goods, folder: Path, children: int) -> None:
        self._goods, self._folder = goods, folder
        self._pool = ThreadPoolExecutor(children, "corpus")
        self._own = threading.local()
        self._children: list[_Child] = []

    def start(self, cases: Sequence[Case]) -> dict[str, Future[Outcome]]:
        """Every case's outcome, some day."""
        return {case.id: self._pool.submit(self._run, case) for case in cases}

    def close(self) -> None:
        """End the processes, and leave out what has not begun."""
        self._pool.shutdown(cancel_futures=True)
        for child in self._children:
            child.close()

    def _run(self, case: Case) -> Outcome:
        folder = self._folder / case.id.replace("/", "_")
        inside, scratch = folder / "case", folder / "tmp"
        inside.mkdir(parents=True)
        scratch.mkdir()
        place(case.files(self._goods), inside)
        before = contents(inside)
        words = tuple(word.replace("{goods}", str(self._goods.folder)) for word in case.words)
        atlas = self._goods.folder / "atlas.safetensors"
        child = self._child()
        report, death = child.run(Job(case.program, words, inside, scratch, atlas))
        left = tuple(sorted(str(path.relative_to(scratch)) for path in scratch.rglob("*")))
        return Outcome(case, inside, report, death, before, contents(inside), left, child.last_words(death))

    def _child(self) -> _Child:
        """The process of this thread."""
        if not hasattr(self._own, "child"):
            self._own.child = _Child(self._folder / f"home-{threading.get_ident()}")
            self._children.append(self._own.child)
        child: _Child = self._own.child
        return child


def contents(folder: Path) -> dict[str, bytes]:
    """Every file under a folder, by its path there."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file() and not path.is_symlink())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def forget(outcome: Outcome) -> None:
    """Delete the folder of a case that needs no second look."""
    shutil.rmtree(outcome.folder.parent)


class _Child:
    """A process that is started again when it has died."""

    def __init__(self, home: Path) -> None:
        self._home = home
        self._process: Any = None
        self._connection: Connection | None = None

    def run(self, job: Job) -> tuple[Report | None, str]:
        """The report, or how the process ended."""
        connection = self._alive()
        connection.send(job)
        started = self._own_time_s()
        while not connection.poll(_LOOK_S):
            if self._own_time_s() - started > MOST_SECONDS:
                return None, self._end(f"hangs for {MOST_SECONDS:.0f} s")
            if (held := self._held_mb()) > MOST_MB:
                return None, self._end(f"holds {held:.0f} MB")
        try:
            return connection.recv(), ""
        except EOFError:
            self._process.join()
            return None, self._end(f"died with exit code {self._process.exitcode}")

    def last_words(self, death: str) -> str:
        """What a process that ended wrote last."""
        return (self._home / "stream2").read_text(errors="replace") if death else ""

    def close(self) -> None:
        """End the process, if there is one."""
        if self._process is not None and self._process.is_alive():
            assert self._connection is not None
            self._connection.send(None)
            self._process.join(10)
            self._end("")

    def _alive(self) -> Connection:
        if self._connection is None:
            self._home.mkdir(parents=True, exist_ok=True)
            context = multiprocessing.get_context("spawn")
            self._connection, theirs = context.Pipe()
            self._process = context.Process(target=serve, args=(theirs, self._home))
            self._process.start()
            theirs.close()
        return self._connection

    def _end(self, death: str) -> str:
        self._process.kill()
        self._process.join()
        self._connection = None
        return death

    def _own_time_s(self) -> float:
        """Time that passes, but for what the process waits for a core that others keep busy."""
        try:
            waited_ns = int(Path(f"/proc/{self._process.pid}/schedstat").read_text().split()[1])
        except (FileNotFoundError, ProcessLookupError, IndexError):
            return 0.0
        return time.monotonic() - waited_ns / 1e9

    def _held_mb(self) -> float:
        try:
            pages = int(Path(f"/proc/{self._process.pid}/statm").read_text().split()[1])
        except (FileNotFoundError, ProcessLookupError, IndexError):
            return 0.0
        return pages * os.sysconf("SC_PAGE_SIZE") / 2**20
