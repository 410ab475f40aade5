"""The disentangled shape of one covariate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from naisr_model.progress import Progress
from naisr_viewer.engine.answers.base import plain
from naisr_viewer.state.requests import SurfaceRequest

if TYPE_CHECKING:
    import trimesh

    from naisr_model.atlas import Atlas
    from naisr_model.surface.tracking import Tracker


def _effect(
    atlas: Atlas,
    request: SurfaceRequest,
    latent: NDArray[np.float64] | None,
    tracker: Tracker | None,
    progress: Progress,
) -> trimesh.Trimesh:
    ((name, value),) = request.values
    return atlas.effect(name, value, latent, request.resolution, tracker=tracker, progress=progress)


ANSWER = plain(_effect)
