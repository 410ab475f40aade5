"""``naisr evaluate ...``: a command for every study, made from the study's own options."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Annotated, Any

from cyclopts import App, Parameter

from naisr_model.cli.console import bar, told_anyway, write_json
from naisr_model.cli.options import ClusterAddress, FileToWrite, JsonFile
from naisr_model.errors import InputError
from naisr_model.evaluation.studies import STUDIES
from naisr_model.evaluation.study import Study, run

JournalFile = Annotated[
    FileToWrite | None,
    Parameter(help="keep what is measured in this file, so that the same command goes on where it was."),
]
Workers = Annotated[
    int,
    Parameter(help="processes; one already uses all cores within a case, and each needs its own memory."),
]


def _command(name: str, kind: type[Study[Any]]) -> Callable[..., None]:
    def measure(
        study: Any,
        *,
        journal: JournalFile = None,
        workers: Workers = 1,
        cluster: ClusterAddress = None,
        json_file: JsonFile = None,
    ) -> None:
        if journal is not None and json_file is not None and json_file.resolve() == journal.resolve():
            raise InputError(f"{journal} is to be the journal and the report; name two files")
        with bar(name) as progress:
            report = run(study, workers=workers, cluster=cluster, journal=journal, progress=progress)
        with told_anyway(lambda: print(study.markdown(report))):
            write_json(json_file, report)

    measure.__annotations__["study"] = Annotated[kind, Parameter(name="*")]
    return measure


evaluate = App(name="evaluate", help="Measure how good an atlas is.")
for _name, _kind in STUDIES.items():
    _summary = inspect.getdoc(_kind) or ""
    evaluate.command(_command(_name, _kind), name=_name, help=_summary.partition("\n")[0])
