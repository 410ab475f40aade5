"""What is shown, as a table that a spreadsheet takes."""

from __future__ import annotations

from collections.abc import Sequence

from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.requests import SurfaceResult

Row = tuple[str, SurfaceResult, float | None]
"""Title of a view, its surface, and the area of its cut (mm²); None where there is none."""


def table(state: ExplorerState, rows: Sequence[Row]) -> str:
    """Lines of cells between tabs, the first with names and units: view, covariates, extent, its margin, cut.

    The extent is a volume, or of curves an area. Numbers have a decimal point; what a surface does not
    depend on, or is not known, is left empty.

    Args:
        state: what is explored; there is an atlas.
        rows: what is shown.
    """
    assert state.atlas is not None
    covariates = state.atlas.covariates
    names = [f"{each.name} [{each.unit}]" if each.unit else each.name for each in covariates]
    extent = state.atlas.frame.extent
    enclosed = [f"{extent.title} [{extent.unit}]", f"half of 95 % interval [{extent.unit}]"]
    lines = [["view", *names, *enclosed, "cut [mm²]"]]
    for title, result, cut_mm2 in rows:
        values = dict(result.request.values)
        told = [each.format(values[each.name]) if each.name in values else "" for each in covariates]
        told = [text.removesuffix(each.unit).strip() for text, each in zip(told, covariates, strict=True)]
        volumes = (result.extent if len(result.faces) else None, result.extent_margin, cut_mm2)
        lines.append([title, *told, *("" if each is None else f"{each:.6g}" for each in volumes)])
    return "".join("\t".join(" ".join(cell.split()) for cell in line) + "\n" for line in lines)
