"""Requests to results: the one place where the viewer meets the model. Knows no Qt."""

from __future__ import annotations

import contextlib
import hashlib
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

import numpy as np
import platformdirs
from numpy.typing import NDArray

from naisr_model import __version__ as VERSION
from naisr_model.errors import Cancelled, InputError
from naisr_viewer.requests import EXACT_RESOLUTION, Origin, SurfaceRequest, SurfaceResult
from naisr_viewer.state import TEMPLATE, AtlasCard, Panel

if TYPE_CHECKING:
    import trimesh

    from naisr_model.atlas import Atlas
    from naisr_model.covariates import Covariate
    from naisr_model.surface.displacements import DisplacementTables
    from naisr_model.surface.tracking import Tracked, Tracker

__all__ = ["VERSION", "Cancelled", "Engine", "InputError", "load_atlas"]

CACHED_SURFACES = 96
"""How many surfaces are kept; an exact one takes about 3 MB."""

OPEN_ATLASES = 2
"""How many atlases are kept loaded, so that going back to the last one is instant."""

KEPT_TABLES = 8
"""How many atlases' tabulated displacements are kept on disk; some MB each."""

Progress = Callable[[float], None]
ShouldStop = Callable[[], bool]


def load_atlas(path: Path) -> Atlas:
    """Read an atlas file; here, because importing the model takes over a second."""
    from naisr_model.atlas import Atlas

    return Atlas.load(path)


def cache_folder() -> Path:
    """Where tabulated displacements are kept between two runs of the program."""
    return platformdirs.user_cache_path("naisr-viewer", appauthor=False)


class Engine:
    """Opens atlases and answers surface requests, remembering the recent answers.

    Args:
        load: reads an atlas file; raises :class:`InputError` on one it cannot use.
        cache: folder for tabulated displacements.
    """

    def __init__(self, load: Callable[[Path], Atlas] = load_atlas, cache: Path | None = None) -> None:
        self._load = load
        self._cache = cache or cache_folder()
        self._lock = Lock()
        self._atlases: OrderedDict[Path, Atlas] = OrderedDict()
        self._trackers: dict[Path, Tracker] = {}
        self._tracked: dict[tuple[Path, Panel], Tracked] = {}
        self._preview: SurfaceResult | None = None  # the last one; sub-plots may show the same surface
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
                self._forget(self._atlases.popitem(last=False)[0])
            self._forget(path)
            for stale in [request for request in self._results if request.atlas == path]:
                del self._results[stale]
        return AtlasCard(path, atlas.name, tuple(atlas.covariates), atlas.population)

    def _forget(self, path: Path) -> None:
        self._preview = None
        self._trackers.pop(path, None)
        for key in [key for key in self._tracked if key[0] == path]:
            del self._tracked[key]

    def prepare_previews(
        self, path: Path, progress: Progress | None = None, should_stop: ShouldStop | None = None
    ) -> None:
        """Make previews of an open atlas fast: tabulate its displacements, or read them from the disk.

        Raises:
            Cancelled: when ``should_stop()`` turned true.
        """
        import trimesh

        with self._lock:
            atlas = self._atlases[path]
        shown = self.surface(SurfaceRequest(path, TEMPLATE, (), EXACT_RESOLUTION), None, should_stop)
        if not len(shown.faces):
            return
        template = trimesh.Trimesh(shown.points_mm, shown.faces, process=False)
        tables = self._tables(path, atlas, template, progress, should_stop)
        tracker = atlas.tracker(template, tables)
        with self._lock:
            if self._atlases.get(path) is atlas:
                self._trackers[path] = tracker

    def has_previews(self, path: Path) -> bool:
        """Whether :meth:`prepare_previews` is done for an atlas."""
        return path in self._trackers

    def _tables(
        self,
        path: Path,
        atlas: Atlas,
        template: trimesh.Trimesh,
        progress: Progress | None,
        should_stop: ShouldStop | None,
    ) -> DisplacementTables:
        """Those on the disk for exactly this file, or new ones; a cache that fails costs time, no more."""
        from naisr_model.surface.displacements import RECIPE, DisplacementTables

        key = hashlib.sha256(path.read_bytes() + RECIPE.encode()).hexdigest()[:32]
        file = self._cache / f"{key}.displacements.safetensors"
        with contextlib.suppress(InputError):
            return DisplacementTables.load(file)
        tables = atlas.tabulate(template, progress=progress, should_stop=should_stop)
        with contextlib.suppress(OSError):
            tables.save(file)
            kept = sorted(self._cache.glob("*.displacements.safetensors"), key=lambda f: f.stat().st_mtime)
            for old in kept[:-KEPT_TABLES]:
                old.unlink(missing_ok=True)
        return tables

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
            atlas, tracker = self._atlases[request.atlas], self._trackers.get(request.atlas)
        start = time.perf_counter()
        question = simplest(request, atlas.covariates)
        if tracker is not None and request.resolution < EXACT_RESOLUTION:
            if self._preview is None or self._preview.request != question:
                self._preview = _tracked_result(question, tracker, self._track(request, tracker), start)
            return replace(self._preview, request=request)
        result = _result(question, _mesh(atlas, question, progress, should_stop), start)
        if should_stop is not None and should_stop():
            raise Cancelled
        if tracker is not None and len(result.faces):
            error_mm = _deviation_mm(self._track(request, tracker).points_mm, result)
            result = replace(result, preview_error_mm=error_mm)
        with self._lock:
            self._results[question] = result
            while len(self._results) > CACHED_SURFACES:
                self._results.popitem(last=False)
        return replace(result, request=request)

    def _track(self, request: SurfaceRequest, tracker: Tracker) -> Tracked:
        """Carry the template, beginning where the panel's last preview ended."""
        key = (request.atlas, request.panel)
        tracked = tracker.track(dict(request.values), self._tracked.get(key))
        if tracked.is_trustworthy:
            self._tracked[key] = tracked
        return tracked


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


def _tracked_result(
    request: SurfaceRequest, tracker: Tracker, tracked: Tracked, start: float
) -> SurfaceResult:
    from naisr_model.surface.tracking import enclosed_volume

    return SurfaceResult(
        request=request,
        points_mm=tracked.points_mm,
        normals=tracked.normals,
        faces=tracker.faces,
        volume_cm3=enclosed_volume(tracked.points_mm, tracker.faces) / 1000.0,
        seconds=time.perf_counter() - start,
        origin=Origin.TABLES,
        doubtful=not tracked.is_trustworthy,
    )


def _deviation_mm(points_mm: NDArray[np.float32], exact: SurfaceResult) -> float:
    """Distance to the exact surface that 99 % of the points keep, along the normal of the nearest vertex."""
    from scipy.spatial import cKDTree

    nearest = cKDTree(exact.points_mm).query(points_mm)[1]
    offsets = points_mm - exact.points_mm[nearest]
    return float(np.quantile(np.abs(np.sum(offsets * exact.normals[nearest], axis=1)), 0.99))


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
        origin=Origin.NETWORK,
    )
