"""Jobs of which a journal keeps some already: the others are done now, and kept one by one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from naisr_model.progress import Progress
from naisr_model.work.journal import Keep, Record, plain
from naisr_model.work.run import Job, Run


def resumed(
    function: Callable[..., Record],
    jobs: Mapping[str, Job],
    kept: Mapping[str, Record],
    keep: Keep,
    run: Run,
    progress: Progress,
    *,
    is_here: bool,
) -> dict[str, Record]:
    """The record of every job, by its key.

    Args:
        function: of a job; it takes ``progress``, too.
        jobs: by key, one or more.
        kept: what the journal has.
        keep: puts another record into it.
        run: does the jobs.
        progress: told the finished share.
        is_here: whether that is in this process; from others it cannot be asked whether anybody waits, and a
            job goes with its process.

    Raises:
        InputError: when a process died.
        Cancelled: when nobody waits any more.
    """
    missing = [key for key in jobs if key not in kept]
    left = progress.part(1 - len(missing) / len(jobs), 1.0)
    measure = partial(function, progress=left.quiet) if is_here else function
    records = {key: kept[key] for key in jobs if key in kept}
    for number, record in run(measure, [jobs[key] for key in missing], left):
        keep(missing[number], record)
        records[missing[number]] = plain(record)
    return records
