"""``naisr bench``: how fast everything is."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from naisr_model.cli.console import bar, told_anyway, write_json
from naisr_model.cli.options import JsonFile
from naisr_model.shipped import shipped_atlas


def bench(
    atlas: Annotated[
        Path | None,
        Parameter(help="the .safetensors file; left out, the airway atlas that comes with the program."),
    ] = None,
    *,
    json_file: JsonFile = None,
    quick: Annotated[
        bool,
        Parameter(help="see in less than a minute that everything runs; the figures then say little."),
    ] = False,
    device: Annotated[
        str, Parameter(help="where networks are evaluated and trained: cpu, cuda or mps.")
    ] = "cpu",
) -> None:
    """Measure how fast everything is on this machine, at the paper's network size; takes some minutes."""
    from naisr_model.benchmark.bench import bench as run
    from naisr_model.benchmark.bench import markdown
    from naisr_model.benchmark.subject import QUICK, Scope

    scope = QUICK if quick else Scope()
    with bar("measuring") as progress:
        record = run(atlas or shipped_atlas(), scope, device=device, progress=progress)
    with told_anyway(lambda: print(markdown(record, scope))):
        write_json(json_file, record)
