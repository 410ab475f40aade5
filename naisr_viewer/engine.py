"""Requests to results: the one place where the viewer meets the model. Knows no Qt."""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

import numpy as np

from naisr_model import __version__ as VERSION
from naisr_model.errors import Cancelled, InputError
from naisr_viewer.requests import SurfaceRequest, SurfaceResult
from naisr_viewer.state import TEMPLATE, AtlasCard, Panel

if TYPE_CHECKING:
    import trimesh

    from naisr_model.atlas import Atlas
    from naisr_model.covariates import Covariate

__all__ = ["VERSION", "Cancelled", "Engine", "InputError", "load_atlas"]

CACHED_SURFACES = 96
"""How many surfaces are kept; an exact one takes about 3 MB."""

OPEN_ATLASES = 2
"""How many atlases are kept loaded, so that going back to the last one is instant."""

Progress = Callable[[float], None]
ShouldStop = Callable[[], bool]


def load_atlas(path: Path) -> Atlas:
    """Read an atlas file; here, because importing the model takes over a second."""
    from naisr_model.atlas import Atlas

    return Atlas.load(path)


class Engine:
    """Opens atlases and answers surface requests, remembering the recent answers.

    Args:
        load: reads an atlas file; raises :class:`InputError` on one it cannot use.
    """

    def __init__(self, load: Callable[[Path], Atlas] = load_atlas) -> None:
        self._load = load
        self._lock = Lock()
        self._atlases: OrderedDict[Path, Atlas] = OrderedDict()
        self._results: OrderedDict[SurfaceRequest, SurfaceResult] = OrderedDict()

    def open(self, path: Path) -> AtlasCard:
        """Read ``path`` afresh and describe it.

        Raises:
            InputError: when there is no such file or it is not an atlas of surfaces.
        """
        if not path.is_file():
            raise InputError(f"there is no file {path}; give the path of an atlas (.safetensors)")
        atlas = self._load(path)
        if atlas.frame.dim != 3:
            raise InputError(
                f"{path.name} is an atlas of {atlas.frame.dim}D shapes; the viewer shows 3D ones"
            )
        with self._lock:
            self._atlases[path] = atlas
            self._atlases.move_to_end(path)
            while len(self._atlases) > OPEN_ATLASES:
                self._atlases.popitem(last=False)
            for stale in [request for request in self._results if request.atlas == path]:
                del self._results[stale]
        return AtlasCard(path, atlas.name, tuple(atlas.covariates), atlas.population)

    def cached(self, request: SurfaceRequest) -> SurfaceResult | None:
        """The answer, if it is remembered; instant."""
        with self._lock:
            question = simplest(request, self._atlases[request.atlas].covariates)
            result = self._results.get(question)
            if result is None:
                return None
            self._results.move_to_end(question)
        return replace(result, request=request)

    def surface(
        self,
        request: SurfaceRequest,
        progress: Progress | None = None,
        should_stop: ShouldStop | None = None,
    ) -> SurfaceResult:
        """Answer ``request``.

        Raises:
            Cancelled: when ``should_stop()`` turned true.
            InputError: when the values are outside the atlas.
        """
        if (remembered := self.cached(request)) is not None:
            return remembered
        with self._lock:
            atlas = self._atlases[request.atlas]
        question = simplest(request, atlas.covariates)
        start = time.perf_counter()
        result = _result(question, _mesh(atlas, question, progress, should_stop), start)
        if should_stop is not None and should_stop():
            raise Cancelled
        with self._lock:
            self._results[question] = result
            while len(self._results) > CACHED_SURFACES:
                self._results.popitem(last=False)
        return replace(result, request=request)


def simplest(request: SurfaceRequest, covariates: tuple[Covariate, ...]) -> SurfaceRequest:
    """The request with the fewest covariates that has the same surface as ``request``.

    g_i vanishes where covariate i is at its centre, so Phi with a single covariate off its centre is
    that covariate's Phi_i, and with none it is the template T.
    """
    centre = {covariate.name: covariate.centre for covariate in covariates}
    moved = tuple((name, value) for name, value in request.values if value != centre[name])
    if len(moved) > 1:
        return replace(request, values=moved)
    panel = Panel("effect", moved[0][0]) if moved else TEMPLATE
    return replace(request, panel=panel, values=moved)


def _mesh(
    atlas: Atlas, request: SurfaceRequest, progress: Progress | None, should_stop: ShouldStop | None
) -> trimesh.Trimesh:
    panel, size = request.panel, request.resolution
    if panel.kind == "template":
        return atlas.template(size, progress=progress, should_stop=should_stop)
    if panel.kind == "effect":
        ((name, value),) = request.values
        return atlas.effect(name, value, resolution=size, progress=progress, should_stop=should_stop)
    return atlas.shape(dict(request.values), resolution=size, progress=progress, should_stop=should_stop)


def _result(request: SurfaceRequest, mesh: trimesh.Trimesh, start: float) -> SurfaceResult:
    empty = len(mesh.faces) == 0
    normals = np.zeros((0, 3)) if empty else mesh.vertex_normals
    return SurfaceResult(
        request=request,
        points_mm=np.asarray(mesh.vertices if not empty else np.zeros((0, 3)), dtype=np.float32),
        normals=np.asarray(normals, dtype=np.float32),
        faces=np.asarray(mesh.faces, dtype=np.int64).reshape(-1, 3),
        volume_cm3=0.0 if empty else float(mesh.volume) / 1000.0,
        seconds=time.perf_counter() - start,
    )
