"""``naisr cohort ...``: many scans at once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import App, Parameter

from naisr_model.cli.console import bar
from naisr_model.cli.options import AtlasFile, ClusterAddress, FolderToWrite

cohort = App(name="cohort", help="Fit many scans at once.")


@cohort.command
def fit(
    table: Annotated[
        Path,
        Parameter(
            help="CSV or .xlsx with the columns mesh and subject; visit, label, landmarks, and covariates of "
            "the atlas where they are known. Blanks are inferred, other columns are copied."
        ),
    ],
    *,
    atlas: AtlasFile,
    out: Annotated[
        FolderToWrite, Parameter(help="folder for the results as CSV and Parquet, a page and the journal.")
    ],
    align: Annotated[
        Literal["none", "icp"],
        Parameter(help="onto the atlas's shape at the known covariates; a row with landmarks goes by these."),
    ] = "none",
    label: Annotated[
        str | None, Parameter(help="of label volumes, its number or its name, where the table does not say.")
    ] = None,
    scale: Annotated[
        float | None,
        Parameter(help="millimetres per unit; left out, it is guessed where the size is implausible."),
    ] = None,
    measure: Annotated[
        list[str] | None,
        Parameter(
            help="volume, area, length or narrowest, which is measured of each shape beside the volume; "
            "for several give it again."
        ),
    ] = None,
    workers: Annotated[int | None, Parameter(help="processes; left out, one a core.")] = None,
    cluster: ClusterAddress = None,
) -> None:
    """Fit an atlas to every scan that a table names; one that was stopped goes on where it was.

    What is wrong with a row is told in the results, and stops no other.
    """
    from naisr_model.cohorts.fitting import PAGE, fit_cohort
    from naisr_model.cohorts.rows import CohortOptions
    from naisr_model.cohorts.table import read_cohort
    from naisr_model.data.report import WORDS
    from naisr_model.evaluation.held_out import opened

    chosen = {} if measure is None else {"measures": tuple(dict.fromkeys(measure))}
    options = CohortOptions(align=align, label=label, scale=scale, **chosen)
    for line in read_cohort(table, opened(atlas).covariates).summary:
        print(line, flush=True)
    with bar("fitting") as progress:
        found = fit_cohort(table, atlas, out, options, workers=workers, cluster=cluster, progress=progress)
    for one in found.rejected:
        print(f"{WORDS['refuse']} row {one.row.number} ({one.row.subject}, {one.row.visit}): {one.reason}")
    if found.without:
        print(found.without)
    print(f"{len(found.fitted)} of {len(found.outcomes)} scans fitted; see {out / PAGE}")
