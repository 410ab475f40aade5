"""Many like jobs over processes, or one after the other in this one, with the same results.

>>> with processes(1) as run:
...     in_order(run(abs, [-3, 2]))
[3, 2]
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing.connection import Connection
from operator import itemgetter
from typing import Protocol, TypeVar

from threadpoolctl import threadpool_limits

from naisr_model.errors import InputError
from naisr_model.progress import SILENT, Progress

Job = TypeVar("Job")
Result = TypeVar("Result")

POLL_S = 0.2
"""So long at most a cancelled run waits before it is noticed."""

MOST_WORKERS = 61
"""Windows lets a process wait for no more; whoever has more cores gives each worker more memory."""

THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "IGL_NUM_THREADS")
"""What tells libraries that a process has yet to load how many threads to start."""


class Run(Protocol):
    """What :func:`processes` hands out."""

    def __call__(
        self, function: Callable[[Job], Result], jobs: Sequence[Job], progress: Progress = SILENT
    ) -> Iterator[tuple[int, Result]]:
        """Number of a job and what ``function`` made of it, as each is finished.

        With several processes ``function`` is of a module, and jobs and results can be pickled.

        Raises:
            InputError: when a process died.
            Cancelled: when nobody waits any more.
        """


@contextmanager
def processes(workers: int | None = None) -> Iterator[Run]:
    """Hands out :class:`Run`, over processes that stay until the end; a killed parent takes them along.

    Where the work ends with an exception they leave at once, whatever they are at: what a job writes has to
    bear that.

    Args:
        workers: how many; None for one a core, as far as that goes, 1 to stay in this process.

    Raises:
        InputError: for fewer than one, or more than :data:`MOST_WORKERS`.
    """
    count = min(cores(), MOST_WORKERS) if workers is None else workers
    if not 1 <= count <= MOST_WORKERS:
        raise InputError(f"the number of workers is {count}; give 1 to {MOST_WORKERS}")
    if count == 1:
        yield _run_here
        return
    context = multiprocessing.get_context("spawn")
    # Nothing is ever sent: its end, by a closed end here or a killed parent, is what tells the workers. An
    # event would wait for the answer of a worker that was killed.
    wanted, wanting = context.Pipe(duplex=False)
    # Here each worker says a word when it has started: one that cannot was not killed for lack of memory.
    started, starting = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(
        count, mp_context=context, initializer=_start_worker, initargs=(wanted, starting)
    )
    with wanted, wanting, started, starting:
        try:
            yield partial(_run_in, pool, started)
        except BaseException:
            wanting.close()
            raise
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def in_order(results: Iterable[tuple[int, Result]]) -> list[Result]:
    """What :class:`Run` gives, in the order of the jobs."""
    return [result for _, result in sorted(results, key=itemgetter(0))]


def cores() -> int:
    """Fewer than the machine has where a container or a batch system hands out a share."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _run_here(
    function: Callable[[Job], Result], jobs: Sequence[Job], progress: Progress = SILENT
) -> Iterator[tuple[int, Result]]:
    for (number, job), _ in progress.over(list(enumerate(jobs))):
        yield number, function(job)


def _run_in(
    pool: ProcessPoolExecutor,
    started: Connection,
    function: Callable[[Job], Result],
    jobs: Sequence[Job],
    progress: Progress = SILENT,
) -> Iterator[tuple[int, Result]]:
    try:
        with held_back():
            numbers = {pool.submit(function, job): number for number, job in enumerate(jobs)}
        pending = set(numbers)
        while pending:
            progress.check()
            done, pending = wait(pending, timeout=POLL_S, return_when=FIRST_COMPLETED)
            # A job that failed ends the run, so what else is finished is handed out before it.
            for future in sorted(done, key=lambda one: (one.exception() is not None, numbers[one])):
                yield numbers[future], future.result()
            if done:
                progress.tell(1 - len(pending) / len(jobs))
    except BrokenProcessPool as error:
        if not started.poll():
            raise InputError(
                "no worker process could start: a script that starts some needs its own work to stand under "
                "if __name__ == '__main__'; write it so, or run with one worker"
            ) from error
        raise InputError(
            "a worker process died, most likely for lack of memory; run again with fewer workers"
        ) from error
    except RuntimeError as error:
        if "__mp_main__" in sys.modules:  # a worker that runs the script it was started by, which will tell
            raise SystemExit(1) from error
        raise


@contextmanager
def held_back() -> Iterator[None]:
    """Ctrl+C waits meanwhile, and for good in processes started here: it would kill them on their way."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _start_worker(wanted: Connection, starting: Connection) -> None:
    """One thread a worker, which leaves when its parent does or says so, not at the Ctrl+C of a terminal."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ.update(dict.fromkeys(THREADS, "1"))
    threadpool_limits(1)
    starting.send_bytes(b"!")
    threading.Thread(target=_leave_unwanted, args=(wanted,), daemon=True).start()


def _leave_unwanted(wanted: Connection) -> None:
    """End this process when the other end of ``wanted`` is closed, whatever it is at."""
    with suppress(OSError, EOFError):
        wanted.recv_bytes()
    os._exit(1)
