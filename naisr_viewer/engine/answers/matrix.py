"""A cell of the matrix: the full shape, an effect or the template, and remembered as that."""

from __future__ import annotations

from dataclasses import replace

from naisr_viewer.engine.answers import shape
from naisr_viewer.engine.answers.base import simplest
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.matrix import plain_panel
from naisr_viewer.state.requests import SurfaceRequest


def _question(request: SurfaceRequest, atlas: AtlasCard) -> SurfaceRequest:
    return simplest(replace(request, panel=plain_panel(request.values)), atlas)


ANSWER = replace(shape.ANSWER, question=_question)
