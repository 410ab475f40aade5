"""Surfaces cut by a plane."""

from __future__ import annotations

from naisr_model.surface.sections import section as section_with
from naisr_viewer.state.requests import SurfaceResult
from naisr_viewer.state.section import Cut, Section


def cut_of(result: SurfaceResult, section: Section) -> Cut:
    """Where the plane cuts a surface; milliseconds, so that it follows a hand."""
    found = section_with(result.points_mm, result.faces, section.normal, section.offset_mm)
    return Cut(found.points_mm, found.lines, found.area_mm2)
