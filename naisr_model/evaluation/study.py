"""What an evaluation is: cases that are measured one by one, and a report of all of them.

A study is one file in ``studies`` and one line in its registry: a frozen dataclass, small enough to be sent
to other processes, whose fields are its options, documented under ``Attributes``. :func:`run` does the rest:
it keeps what is measured in a journal, spreads the cases over processes, and sees to it that all of them are
of the same files.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import fields
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar, Protocol, TypeVar

from naisr_model.data.store import INDEX
from naisr_model.errors import InputError
from naisr_model.files import sha256_of, sources_digest
from naisr_model.progress import SILENT, Progress
from naisr_model.work import journal as journals
from naisr_model.work.cluster import shared
from naisr_model.work.journal import Keep, Record, plain
from naisr_model.work.resumed import resumed


class Case(Protocol):
    """One unit of work; it can be pickled."""

    @property
    def key(self) -> str:
        """Its name among the cases of its study, the same in every run."""


CaseType = TypeVar("CaseType", bound=Case)


class Study(Protocol[CaseType]):
    """What can be asked of an atlas."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    def cases(self) -> Sequence[CaseType]:
        """Everything that is to be measured, the same in every run.

        Raises:
            InputError: when an option makes no sense or there is nothing to measure.
        """

    def measure(self, case: CaseType, progress: Progress = SILENT) -> Record:
        """What is found out about one case, in plain JSON types; it depends on no other case."""

    def summarise(self, records: Sequence[Record]) -> Record:
        """The report in plain JSON types, from the records in the order of the cases."""

    def markdown(self, report: Mapping[str, Any]) -> str:
        """The report as tables, with units and definitions."""


def run(
    study: Study[CaseType],
    *,
    workers: int | None = 1,
    cluster: str | None = None,
    journal: Path | None = None,
    progress: Progress = SILENT,
) -> Record:
    """The report of a study.

    Args:
        study: what is asked.
        workers: processes; None for one a core. The report is the same for any number of them. One is the
            default because a single process already uses all cores within a case, several need their memory
            each, and cases that measure time have to have the machine for themselves.
        cluster: of dask workers that share the cases in their place, see :mod:`~naisr_model.work.cluster`.
        journal: file that keeps what is measured, so that a run that was stopped or killed goes on there.
        progress: told the finished share.

    Raises:
        InputError: when there is nothing to measure, the journal is of something else or kept by another run,
            or the atlas or the store was changed meanwhile.
        Cancelled: when nobody waits any more.
    """
    started = identity(study)
    cases = study.cases()
    _require_unchanged(study, started)
    if not cases:
        raise InputError("there is nothing to measure with these options; ask for more")
    if len({case.key for case in cases}) < len(cases):
        raise ValueError(f"two cases of {study} have the same key")
    with shared(workers, cluster) as work, _keeping(journal, started) as (kept, keep):

        def add(key: str, record: Record) -> None:
            _require_unchanged(study, started)
            keep(key, record)

        jobs, is_here = {case.key: case for case in cases}, cluster is None and workers == 1
        records = resumed(study.measure, jobs, kept, add, work, progress, is_here=is_here)
        return _summarised(study, [records[key] for key in jobs], journal if kept else None)


def _summarised(study: Study[Any], records: Sequence[Record], journal: Path | None) -> Record:
    """The report; where some of the records were read from a journal, they may be anything."""
    try:
        return study.summarise(records)
    except (AttributeError, IndexError, KeyError, TypeError) as error:
        if journal is None:
            raise
        raise InputError(
            f"{journal} keeps what this evaluation never measured ({error!r}); delete it, or name another one"
        ) from error


def identity(study: Study[Any]) -> Record:
    """What makes two runs the same: the program, the study, and its options.

    The program and files stand for themselves by their contents, so that they may move.
    """
    options = {field.name: _contents(getattr(study, field.name)) for field in fields(study)}
    return plain({"program": _program(), "study": type(study).__name__, **options})


@lru_cache(maxsize=1)
def _program() -> str:
    """Digest of the code that measures."""
    return sources_digest(Path(__file__).parents[1]).hex()


def _require_unchanged(study: Study[Any], started: Record) -> None:
    """Make sure that the files of a study are still those of its start; a training rewrites its own often."""
    if changed := [name for name, value in identity(study).items() if value != started[name]]:
        raise InputError(
            f"the {changed[0]} {_told(getattr(study, changed[0]))} was changed while it was evaluated; "
            "give a copy, or wait until nobody writes to it, and run again"
        )


def _told(value: Any) -> str:
    return " or ".join(map(str, value)) if isinstance(value, tuple) else str(value)


def _contents(value: Any) -> Any:
    """The value of an option; of a file or a store's index its fingerprint, None where it is missing."""
    if isinstance(value, tuple):
        return [_contents(each) for each in value]
    if not isinstance(value, Path):
        return value
    file = value / INDEX if value.is_dir() else value
    return sha256_of(file) if file.exists() else None


def _keeping(
    journal: Path | None, started: Record
) -> AbstractContextManager[tuple[Mapping[str, Record], Keep]]:
    return nullcontext(({}, _forget)) if journal is None else journals.keeping(journal, started)


def _forget(_key: str, _record: Record) -> None: ...
