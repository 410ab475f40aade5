"""Many like jobs over the workers of a dask cluster, with the same results as over processes.

Functions, jobs and results travel; files do not: workers open them by the same paths from the same folder, so
that storage has to be shared. Only as many jobs are under way as keep the workers busy, however many wait.
"""

from __future__ import annotations

import hashlib
import logging
import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from functools import lru_cache, partial
from importlib import metadata
from itertools import islice
from pathlib import Path
from typing import Any

from naisr_model.errors import InputError
from naisr_model.files import sources_digest
from naisr_model.progress import SILENT, Progress
from naisr_model.work.run import MOST_WORKERS, POLL_S, Job, Result, Run, held_back, processes

AHEAD = 2
"""Jobs under way for each worker: it has the next one when it has finished one."""

PATIENCE_S = 30
"""So long a scheduler, and its first worker, are waited for."""

PACKAGES = ("torch", "numpy", "scipy")
"""On whose versions results depend."""

_LOCAL = re.compile(r"local:([0-9]{1,4})")


def shared(workers: int | None, address: str | None) -> AbstractContextManager[Run]:
    """:func:`~naisr_model.work.run.processes`, or :func:`cluster` where there is an address of one.

    Raises:
        InputError: for several processes and a cluster.
    """
    if address is None:
        return processes(workers)
    if workers not in (None, 1):
        raise InputError("--workers are processes on this machine, --cluster has its own; give one of them")
    return cluster(address)


@contextmanager
def cluster(address: str) -> Iterator[Run]:
    """Hands out :class:`~naisr_model.work.run.Run` over the workers of a cluster.

    A worker that dies takes no result along: what it was at is done again by another one.

    Args:
        address: of the scheduler, as ``tcp://node17:8786``; or ``local:N`` for N workers on this machine.

    Raises:
        InputError: when dask is not installed, nobody answers at the address, or workers run another program.
    """
    with _quiet(), _connected(address) as client:
        _require_same(client)
        yield partial(_run, client)


@lru_cache(maxsize=1)
def program() -> str:
    """What results depend on beside their inputs, as a digest: this program, and packages that it uses."""
    versions = " ".join(map(metadata.version, PACKAGES)).encode()
    return hashlib.sha256(sources_digest(Path(__file__).parents[1]) + versions).hexdigest()


@contextmanager
def _quiet() -> Iterator[None]:
    """Without dask's own log: what matters of it is told in sentences."""
    log = logging.getLogger("distributed")
    before = log.level
    log.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        log.setLevel(before)


@contextmanager
def _connected(address: str) -> Iterator[Any]:
    try:
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise InputError(
            "--cluster needs dask; install it with pip install 'naisr-atlas-explorer[cluster]'"
        ) from error
    if local := _LOCAL.fullmatch(address):
        with held_back():
            own = LocalCluster(
                n_workers=_count(int(local[1])),
                threads_per_worker=1,
                memory_limit=0,
                dashboard_address=None,
                silence_logs=logging.CRITICAL + 1,
            )
        with own, Client(own) as client:
            yield client
        return
    try:
        client = Client(address, timeout=PATIENCE_S)
        client.wait_for_workers(1, timeout=PATIENCE_S)
    except (OSError, TimeoutError, ValueError, TypeError) as error:
        raise InputError(
            f"no cluster answers at '{address}'; give the address of a dask scheduler that has workers, as "
            "tcp://node17:8786, or local:4 for four workers on this machine"
        ) from error
    with client:
        yield client


def _count(workers: int) -> int:
    if not 1 <= workers <= MOST_WORKERS:
        raise InputError(f"the cluster is 'local:{workers}'; give local:1 to local:{MOST_WORKERS}")
    return workers


def _require_same(client: Any) -> None:
    """Make sure that every worker has this program and the same packages."""
    try:
        client.get_versions(check=True)
        found = set(client.run(program).values())
    except (ValueError, ImportError, AttributeError) as error:
        raise _other(str(error).strip().splitlines()[0]) from error
    if found != {program()}:
        raise _other("the sources, or numpy, scipy or torch, differ")


def _other(why: str) -> InputError:
    return InputError(
        f"the workers of the cluster have another program than this one ({why}); install the same on all"
    )


def _there(folder: str, function: Callable[[Job], Result], job: Job) -> Result:
    """On a worker, where relative paths mean what they mean here."""
    try:
        os.chdir(folder)
    except OSError as error:
        raise InputError(
            f"a worker of the cluster cannot get to {folder} ({error.strerror}); give all the same storage"
        ) from error
    return function(job)


def _run(
    client: Any, function: Callable[[Job], Result], jobs: Sequence[Job], progress: Progress = SILENT
) -> Iterator[tuple[int, Result]]:
    from distributed import KilledWorker, wait

    there = partial(_there, os.getcwd(), function)
    waiting, under_way, done = iter(enumerate(jobs)), dict[Any, int](), 0
    try:
        while True:
            room = AHEAD * max(1, len(client.scheduler_info()["workers"])) - len(under_way)
            for number, job in islice(waiting, max(0, room)):
                under_way[client.submit(there, job, pure=False)] = number
            if not under_way:
                return
            progress.check()
            with suppress(TimeoutError):
                wait(list(under_way), timeout=POLL_S, return_when="FIRST_COMPLETED")
            finished = [future for future in under_way if future.done()]
            for future in sorted(finished, key=under_way.__getitem__):
                yield under_way.pop(future), future.result()
                done += 1
                progress.tell(done / len(jobs))
    except KilledWorker as error:
        raise InputError(
            "several workers of the cluster died of one job, most likely for lack of memory; give them more"
        ) from error
    finally:
        client.cancel(list(under_way))
