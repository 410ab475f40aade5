"""Commands that make data to train on: ``populate`` and ``prepare``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from naisr_model.cli.console import bar
from naisr_model.cli.options import ClusterAddress, FolderToWrite
from naisr_model.data.populations import POPULATIONS, population, require_own
from naisr_model.data.remarks import gravest_first
from naisr_model.errors import InputError

PopulationName = Annotated[str, Parameter(help=f"{' or '.join(POPULATIONS)}.")]


def populate(name: PopulationName, out: FolderToWrite, *, patients: int | None = None, seed: int = 0) -> None:
    """Write a synthetic population (meshes, landmarks, CSV) as a hospital would hand it over.

    Args:
        name: one of the populations.
        out: folder to write into.
        patients: how many patients; left out, the population's own number.
        seed: the same seed gives the same files.
    """
    size, module = {} if patients is None else {"patients": patients}, population(name)
    require_own(out, name)
    with bar(f"writing {name}") as progress:
        table = module.write_population(out, seed=seed, progress=progress, **size)
    print(table)


def prepare(
    table: Path,
    *,
    out: FolderToWrite | None = None,
    check: bool = False,
    surface_samples: int = 100_000,
    near_samples: int = 400_000,
    uniform_samples: int = 100_000,
    held_out: float = 0.2,
    seed: int = 0,
    workers: int | None = None,
    cluster: ClusterAddress = None,
    accept: list[int] | None = None,
) -> None:
    """Turn a CSV of meshes and covariates into a store of samples to train on.

    A run that was stopped goes on where it was. What was understood of the table is told first. Meshes
    that cannot be used are listed with the reason and left out.

    Args:
        table: CSV or .xlsx with the columns mesh, subject, visit, then covariates; a TOML file of the same
            name beside it may set units, kinds and the alignment.
        out: folder of the store.
        check: only say what is understood of the table and which files are missing; nothing is written.
        surface_samples: points with normals on each surface.
        near_samples: signed distances close to each surface.
        uniform_samples: signed distances anywhere in the box.
        held_out: share of the subjects kept for evaluation.
        seed: of the split and of the samples.
        workers: processes; left out, one a core.
        cluster: of dask workers in their place.
        accept: a row, the header being 1, that you have looked at and that is right, as a true 999 or the
            mesh of a twin; it is not left out for being unlike the others. For several rows give it again.
    """
    from naisr_model.data.prepare import PrepareOptions, require_possible
    from naisr_model.data.prepare import prepare as run
    from naisr_model.data.tables import missing_files, read_table

    if out is None and not check:
        raise InputError("give the folder of the store, --out FOLDER, or --check to look at the table alone")
    counts, accepted = (surface_samples, near_samples, uniform_samples), tuple(accept or ())
    options = PrepareOptions(*counts, held_out, seed, workers, cluster, accepted)
    require_possible(options)
    read = read_table(table, accepted)
    for line in (*read.summary, *(f"{one.severity}: {one.text}" for one in gravest_first(read.remarks))):
        print(line, flush=True)
    if check or out is None:
        for sentence in missing_files(read):
            print(f"missing {sentence}")
        return
    with bar("preparing") as progress:
        report = run(table, out, options=options, progress=progress)
    for line in report.lines:
        print(line)
    print(
        f"{len(report.accepted)} shapes in {out} ({len(report.skipped)} were there already), "
        f"{len({remark.row for remark in report.rejected})} rejected"
    )
