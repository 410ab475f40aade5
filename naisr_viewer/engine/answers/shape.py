"""The full shape; also the one that changes are counted from."""

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


def _shape(
    atlas: Atlas,
    request: SurfaceRequest,
    latent: NDArray[np.float64] | None,
    tracker: Tracker | None,
    progress: Progress,
) -> trimesh.Trimesh:
    return atlas.shape(dict(request.values), latent, request.resolution, tracker=tracker, progress=progress)


ANSWER = plain(_shape)
