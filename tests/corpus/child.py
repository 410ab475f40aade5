"""One long-lived process that runs case after case, so that not each of them loads torch."""

from __future__ import annotations

import faulthandler
import os
import sys
import tempfile
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path


@dataclass(frozen=True)
class Job:
    """A case to be run.

    Attributes:
        program: see :class:`corpus.case.Case`.
        words: what stands after the command, everything filled in.
        folder: of the case; the command runs there.
        scratch: for temporary files.
        atlas: what the window shows before it opens a scan.
    """

    program: str
    words: tuple[str, ...]
    folder: Path
    scratch: Path
    atlas: Path


@dataclass(frozen=True)
class Report:
    """What the process says of a case.

    Attributes:
        code: exit code; None where an exception came out.
        trace: of that exception.
        out: standard output.
        err: standard error.
        peak_mb: most memory that the process held meanwhile.
    """

    code: int | None
    trace: str
    out: str
    err: str
    peak_mb: float


def serve(connection: Connection, home: Path) -> None:
    """Run jobs until there are no more; the entry point of the process."""
    os.environ |= {"OMP_NUM_THREADS": "1", "HOME": str(home), "XDG_CACHE_HOME": str(home / "cache")}
    # A process of its own says each warning once; this one has to say it of every case.
    warnings.simplefilter("always")
    for unseen in (DeprecationWarning, PendingDeprecationWarning, ImportWarning, ResourceWarning):
        warnings.simplefilter("ignore", unseen)
    try:
        while (job := connection.recv()) is not None:
            connection.send(_run(job, home))
    except EOFError:
        return  # whoever asked is gone


def _run(job: Job, home: Path) -> Report:
    os.chdir(job.folder)
    os.environ["TMPDIR"] = str(job.scratch)
    tempfile.tempdir = None
    _forget_peak()
    trace, code = "", None
    with _captured(home) as told:
        faulthandler.enable(2)
        try:
            code = _called(job)
        except BaseException:
            trace = traceback.format_exc()
    out, err = told
    return Report(code, trace, out, err, _peak_mb())


def _called(job: Job) -> int:
    if job.program != "naisr":
        from corpus.window import opened

        return opened(job)
    from naisr_model.cli import main

    return main(job.words)


@contextmanager
def _captured(home: Path) -> Iterator[list[str]]:
    """What is written to the two streams by whatever means, in a list when it is over."""
    told: list[str] = []
    files = [(home / f"stream{number}").open("w+b") for number in (1, 2)]
    sys.stdout.flush()
    kept = [os.dup(number) for number in (1, 2)]
    try:
        for number, file in zip((1, 2), files, strict=True):
            os.dup2(file.fileno(), number)
        yield told
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        for number, descriptor, file in zip((1, 2), kept, files, strict=True):
            os.dup2(descriptor, number)
            os.close(descriptor)
            file.seek(0)
            told.append(file.read().decode(errors="replace"))
            file.close()


def _forget_peak() -> None:
    """Begin anew to count the most memory, which Linux offers."""
    Path("/proc/self/clear_refs").write_text("5")


def _peak_mb() -> float:
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:")) / 1024
