"""A cohort fitted: every row over processes, a journal to go on from, and the files that tell of it.

>>> from pathlib import Path
>>> cohort = fit_cohort(Path("table.csv"), Path("atlas.safetensors"), Path("out"))  # doctest: +SKIP
>>> [one.record["covariates"]["age"] for one in cohort.fitted]  # doctest: +SKIP
[84.2, 131.0]
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection
from dataclasses import asdict
from functools import partial
from pathlib import Path

from naisr_model.atlas import Atlas
from naisr_model.cohorts.page import page
from naisr_model.cohorts.results import Cohort, Outcome, as_csv, as_parquet, require_distinct
from naisr_model.cohorts.rows import Bench, CohortOptions, fit_row
from naisr_model.cohorts.table import CohortRow, read_cohort
from naisr_model.errors import InputError
from naisr_model.evaluation.held_out import opened
from naisr_model.files import sha256_of, stamp_of, write_all
from naisr_model.measures.kept import load_norms, save_norms
from naisr_model.measures.kinds import MEASURES
from naisr_model.measures.norms import Norms, norms_of
from naisr_model.progress import SILENT, Progress
from naisr_model.work.cluster import program, shared
from naisr_model.work.journal import Record, keeping, plain
from naisr_model.work.resumed import resumed

JOURNAL, CSV, PARQUET, PAGE = "journal.jsonl", "results.csv", "results.parquet", "report.html"

KNOWING, TELLING = 0.05, 0.98
"""Share of the work after which it is known what is usual, and after which all rows are done."""


def fit_cohort(
    table: Path,
    atlas: Path,
    out: Path,
    options: CohortOptions | None = None,
    *,
    workers: int | None = None,
    cluster: str | None = None,
    progress: Progress = SILENT,
) -> Cohort:
    """Fit an atlas to every scan that a table names, and write what was found into a folder.

    A run that was stopped, or killed at any moment, goes on where it was, with the same results. A row that
    was changed in the table, and a scan that was changed on the disk, is fitted again.

    Args:
        table: as :func:`~naisr_model.cohorts.table.read_cohort` takes it.
        atlas: the .safetensors file.
        out: folder of ``results.csv``, ``results.parquet``, ``report.html`` and the journal.
        options: how scans are read, and what is measured of them.
        workers: processes; None for one a core. The results are the same for any number.
        cluster: of dask workers that share the work in their place, see :mod:`~naisr_model.work.cluster`.
        progress: told the finished share.

    Raises:
        InputError: when the table or the atlas cannot be used, or the folder holds something else.
        Cancelled: when nobody waits any more.
    """
    table, atlas, out = table.absolute(), atlas.absolute(), out.absolute()
    options, share = options or CohortOptions(), shared(workers, cluster)
    model, stamp = opened(atlas), stamp_of(atlas)
    require_measures(options.measures, model)
    read = read_cohort(table, model.covariates)
    require_distinct(read, model)
    _require_own(out)
    digest = sha256_of(atlas)
    identity = plain({"program": program(), "atlas": digest, **asdict(options)})
    with keeping(out / JOURNAL, identity) as (kept, keep):
        norms_file = out / f"norms-{digest[:12]}.safetensors"
        usual, why = _norms(model, norms_file, progress.part(0.0, KNOWING))
        bench = Bench(atlas, None if usual is None else norms_file, options)

        def add(key: str, record: Record) -> None:
            if stamp_of(atlas) != stamp:
                raise InputError(f"{atlas} was changed meanwhile; give a copy that nobody writes to")
            keep(key, record)

        keys = [_key(row) for row in read.rows]
        rows = dict(zip(keys, read.rows, strict=True))
        fit, is_here = partial(fit_row, bench), cluster is None and workers == 1
        with share as run:
            left = progress.part(KNOWING, TELLING)
            found = resumed(fit, rows, kept, add, run, left, is_here=is_here)
        outcomes = tuple(Outcome(row, found[key]) for key, row in zip(keys, read.rows, strict=True))
        cohort = Cohort(read, outcomes, model, usual, why)
        write_all(
            [(out / CSV, as_csv(cohort)), (out / PARQUET, as_parquet(cohort)), (out / PAGE, page(cohort))]
        )
    progress.tell(1.0)
    return cohort


def require_measures(names: Collection[str], atlas: Atlas) -> None:
    """Make sure that measures are among those that can be asked for.

    Raises:
        InputError: for another name, and for curves in the plane for all but their area.
    """
    if unknown := [name for name in names if name not in MEASURES]:
        raise InputError(f"there is no measure '{unknown[0]}'; give {', '.join(MEASURES)}")
    if atlas.frame.dim == 2 and set(names) - {"area"}:
        raise InputError("of curves in the plane the area is measured, and nothing else; leave out --measure")


def _norms(atlas: Atlas, file: Path, progress: Progress) -> tuple[Norms | None, str]:
    """What is usual among the atlas's people, kept in a file; or why nobody knows."""
    try:
        return load_norms(file, atlas), ""
    except InputError:
        pass
    try:
        found = norms_of(atlas, progress=progress)
    except InputError as error:
        return None, f"no percentiles: {error}"
    save_norms(found, file)
    return found, ""


def _key(row: CohortRow) -> str:
    """Its name in the journal, another one when the row or a file of it is changed; rows may be moved."""
    files = [path for path in (row.scan, row.landmarks) if path is not None]
    told = {**asdict(row), "number": 0, "copied": (), "stamps": [stamp_of(path) for path in files]}
    digest = hashlib.sha256(json.dumps(told, default=str).encode()).hexdigest()
    return f"{row.subject}/{row.visit}/{digest[:16]}"


def _require_own(out: Path) -> None:
    """Results without their journal are somebody else's."""
    if (out / JOURNAL).exists():
        return
    if others := [name for name in (CSV, PARQUET, PAGE) if (out / name).exists()]:
        raise InputError(f"{out} holds {others[0]} of something else; give another folder")
