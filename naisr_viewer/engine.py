"""Requests to results: the one place where the viewer meets the model. Knows no Qt."""

from __future__ import annotations

import contextlib
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from naisr_model import __version__ as VERSION
from naisr_model.errors import Cancelled, InputError
from naisr_model.files import replacing
from naisr_viewer import cache, members
from naisr_viewer.members import Member
from naisr_viewer.patients import Named
from naisr_viewer.requests import EXACT_RESOLUTION, Origin, SurfaceRequest, SurfaceResult
from naisr_viewer.state import FULL_SHAPE, TEMPLATE, AtlasCard, Panel

if TYPE_CHECKING:
    import trimesh

    from naisr_model.atlas import Atlas
    from naisr_model.covariates import Covariate
    from naisr_model.surface.displacements import DisplacementTables
    from naisr_model.surface.tracking import Tracked, Tracker

__all__ = ["VERSION", "Cancelled", "Engine", "InputError", "load_atlas"]

CACHED_SURFACES = 96
"""How many surfaces are kept; an exact one takes about 3 MB."""

KEPT_TRACKERS = 4
"""How many persons' previews stay fast; each takes about 20 MB."""

POLL_S = 0.05
"""Between two looks at ``should_stop`` while another thread prepares previews."""

COLOURED = ("scan", "certainty", "change")
"""Panels of a patient with numbers on their surface."""

OPEN_ATLASES = 2
"""How many atlases are kept open, so that going back to the last one is instant."""

Progress = Callable[[float], None]
ShouldStop = Callable[[], bool]


def load_atlas(path: Path, device: str = "cpu") -> Atlas:
    """Read an atlas file; here, because importing the model takes over a second."""
    from naisr_model.atlas import Atlas

    return Atlas.load(path, device)


@dataclass(frozen=True, eq=False)
class Opened:
    """An atlas that is open; its networks may still have to be loaded.

    Attributes:
        card: what the window knows of it.
        fingerprint: of its file and this program.
        was_kept: whether the card and the template came from the cache.
    """

    card: AtlasCard
    fingerprint: str
    was_kept: bool


class Engine:
    """Opens atlases and answers surface requests, remembering the recent answers.

    Importing and loading networks takes seconds. Of an atlas that was open before, the card and the exact
    template are in the cache, so that the first picture does not wait for them.

    Args:
        load: reads an atlas file; raises :class:`InputError` on one it cannot use.
        folder: where to keep what saves time in the next run; the user's own cache when left out.
    """

    def __init__(self, load: Callable[[Path], Atlas] = load_atlas, folder: Path | None = None) -> None:
        self._load = load
        self._folder = folder or cache.cache_folder()
        self._lock = Lock()
        self._loading = Lock()
        self._opened: OrderedDict[Path, Opened] = OrderedDict()
        self._atlases: dict[Path, Atlas] = {}
        self._members: dict[int, Member] = {}
        self._persons = count(1)
        self._preparing = Lock()
        self._trackers: OrderedDict[tuple[Path, int], Tracker] = OrderedDict()
        self._tracked: dict[tuple[Path, int, Panel], Tracked] = {}
        self._before: tuple[Path, int, Named, Tracked] | None = None  # what changes were last counted from
        self._preview: SurfaceResult | None = None  # the last one; sub-plots may show the same surface
        self._results: OrderedDict[SurfaceRequest, SurfaceResult] = OrderedDict()

    def open(self, path: Path) -> AtlasCard:
        """Read ``path`` afresh and describe it.

        Raises:
            InputError: when there is no such file or it is not an atlas of surfaces.
        """
        if not path.is_file():
            raise InputError(f"there is no file {path}; give the path of an atlas (.safetensors)")
        fingerprint = cache.fingerprint(path)
        with contextlib.suppress(InputError):
            kept = cache.read_opening(self._file(fingerprint, cache.OPENING), _template(path))
            self._begin(Opened(kept.card, fingerprint, was_kept=True), None, kept.template)
            return kept.card
        atlas = self._load(path)
        if atlas.frame.dim != 3:
            raise InputError(
                f"{path.name} is an atlas of {atlas.frame.dim}D shapes; the viewer shows 3D ones"
            )
        if cache.fingerprint(path) != fingerprint:  # replaced meanwhile, as a training does now and then
            return self.open(path)
        card = AtlasCard(path, atlas.name, tuple(atlas.covariates), atlas.population)
        self._begin(Opened(card, fingerprint, was_kept=False), atlas, None)
        return card

    def was_kept(self, path: Path) -> bool:
        """Whether the first picture of an open atlas came from the cache."""
        return self._opened[path].was_kept

    def _begin(self, opened: Opened, atlas: Atlas | None, template: SurfaceResult | None) -> None:
        path = opened.card.path
        with self._lock:
            self._forget(path)
            self._opened[path] = opened
            if atlas is not None:
                self._atlases[path] = atlas
            if template is not None:
                self._results[template.request] = template
            while len(self._opened) > OPEN_ATLASES:
                self._forget(next(iter(self._opened)))

    def _forget(self, path: Path) -> None:
        self._opened.pop(path, None)
        self._atlases.pop(path, None)
        self._members = {number: each for number, each in self._members.items() if each.atlas != path}
        self._forget_surfaces(lambda atlas, _: atlas == path)

    def _forget_surfaces(self, is_meant: Callable[[Path, int], bool]) -> None:
        """Of these persons, by atlas and number."""
        self._preview = self._before = None
        for key in [key for key in self._trackers if is_meant(*key)]:
            del self._trackers[key]
        for panel_key in [key for key in self._tracked if is_meant(*key[:2])]:
            del self._tracked[panel_key]
        for stale in [each for each in self._results if is_meant(each.atlas, each.person)]:
            del self._results[stale]

    def admit(self, member: Member) -> int:
        """Answer for someone who was fitted, too; returns the number that requests name the person by."""
        with self._lock:
            person = next(self._persons)
            self._members[person] = member
        return person

    def dismiss(self, person: int) -> None:
        """Forget someone."""
        with self._lock:
            self._members.pop(person, None)
            self._forget_surfaces(lambda _, number: number == person)

    def atlas(self, path: Path) -> Atlas:
        """The networks of an open atlas, loaded when they are first needed.

        Raises:
            InputError: when the file has been replaced since it was opened.
        """
        with self._loading:
            with self._lock:
                opened, atlas = self._opened[path], self._atlases.get(path)
            if atlas is None:
                atlas = self._load(path)
                if cache.fingerprint(path) != opened.fingerprint:
                    raise InputError(f"{path.name} has changed since it was opened; open it again")
                with self._lock:
                    if self._opened.get(path) is opened:
                        self._atlases[path] = atlas
            return atlas

    def _file(self, fingerprint: str, ending: str) -> Path:
        return self._folder / f"{fingerprint}.{ending}"

    def prepare_previews(
        self,
        path: Path,
        person: int = 0,
        progress: Progress | None = None,
        should_stop: ShouldStop | None = None,
    ) -> None:
        """Make previews of a person fast: tabulate the displacements, or read them from the disk.

        The disk holds those of the population average; what the next run shows first is kept with them.

        Raises:
            Cancelled: when ``should_stop()`` turned true.
            InputError: when the file has been replaced since it was opened.
        """
        with _held(self._preparing, should_stop):
            if not self.has_previews(path, person):
                self._prepare(path, person, progress, should_stop)

    def _prepare(
        self, path: Path, person: int, progress: Progress | None, should_stop: ShouldStop | None
    ) -> None:
        import trimesh

        opened, member, _ = self._who(path, person)
        atlas, shown = self.atlas(path), self.surface(_template(path), None, should_stop)
        if not len(shown.faces):
            return
        if not opened.was_kept:
            self._keep_opening(opened, shown)
        template = trimesh.Trimesh(shown.points_mm, shown.faces, process=False)
        if member is None:
            tables = self._tables(opened, atlas, template, progress, should_stop)
        else:
            latent = member.fit.latent
            tables = atlas.tabulate(template, latent, progress=progress, should_stop=should_stop)
        tracker = atlas.tracker(template, tables)
        with self._lock:
            if self._opened.get(path) is opened and (not person or person in self._members):
                self._trackers[path, person] = tracker
            while len(self._trackers) > KEPT_TRACKERS:
                self._trackers.popitem(last=False)

    def has_previews(self, path: Path, person: int = 0) -> bool:
        """Whether :meth:`prepare_previews` is done for a person."""
        return (path, person) in self._trackers

    def _who(self, path: Path, person: int) -> tuple[Opened, Member | None, Tracker | None]:
        """Whom a request is about; nobody asks any more for an atlas or a person that is not there."""
        with self._lock:
            opened, member = self._opened.get(path), self._members.get(person)
            if opened is None or (person and member is None):
                raise Cancelled
            return opened, member, self._trackers.get((path, person))

    def _keep_opening(self, opened: Opened, template: SurfaceResult) -> None:
        file = self._file(opened.fingerprint, cache.OPENING)
        with contextlib.suppress(OSError):
            with replacing(file) as temporary:
                cache.write_opening(temporary, cache.Opening(opened.card, template))
            cache.forget_oldest(self._folder, cache.OPENING)

    def _tables(
        self,
        opened: Opened,
        atlas: Atlas,
        template: trimesh.Trimesh,
        progress: Progress | None,
        should_stop: ShouldStop | None,
    ) -> DisplacementTables:
        """Those on the disk for exactly this file, or new ones; a cache that fails costs time, no more."""
        from naisr_model.surface.displacements import DisplacementTables

        file = self._file(opened.fingerprint, cache.DISPLACEMENTS)
        with contextlib.suppress(InputError):
            return DisplacementTables.load(file)
        tables = atlas.tabulate(template, progress=progress, should_stop=should_stop)
        with contextlib.suppress(OSError):
            tables.save(file)
            cache.forget_oldest(self._folder, cache.DISPLACEMENTS)
        return tables

    def cached(self, request: SurfaceRequest) -> SurfaceResult | None:
        """The answer, if it is remembered; instant."""
        with self._lock:
            question = simplest(request, self._opened[request.atlas].card.covariates)
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
            InputError: when the values are outside the atlas, or its file has been replaced since it was
                opened.
        """
        if (remembered := self.cached(request)) is not None:
            return remembered
        if request.panel.kind in COLOURED:
            return self._coloured(request, progress, should_stop)
        opened, member, tracker = self._who(request.atlas, request.person)
        question = simplest(request, opened.card.covariates)
        if tracker is not None and request.resolution < EXACT_RESOLUTION:
            start, preview = time.perf_counter(), self._preview
            if preview is None or preview.request != question:
                preview = _tracked_result(question, tracker, self._track(request, tracker), start)
                self._preview = preview
            return replace(preview, request=request)
        atlas = self.atlas(request.atlas)
        start = time.perf_counter()
        latent = None if member is None else member.fit.latent
        mesh = _mesh(atlas, question, latent, tracker, progress, should_stop)
        if should_stop is not None and should_stop():
            raise Cancelled
        result = _result(question, mesh, start)
        if member is not None and question.person and result.is_exact:
            margin_cm3 = members.margin_cm3(member, question.values, mesh)
            result = replace(result, volume_margin_cm3=margin_cm3)
        if tracker is not None and len(result.faces):
            error_mm = _deviation_mm(self._track(request, tracker).points_mm, result)
            result = replace(result, preview_error_mm=error_mm)
        self._remember(opened, question, result)
        return replace(result, request=request)

    def _remember(self, opened: Opened, question: SurfaceRequest, result: SurfaceResult) -> None:
        """Unless the atlas was opened anew, or the person dismissed, meanwhile."""
        with self._lock:
            is_same = self._opened.get(question.atlas) is opened
            if is_same and (not question.person or question.person in self._members):
                self._results[question] = result
            while len(self._results) > CACHED_SURFACES:  # templates stay: all tables are made of one mesh
                del self._results[next(each for each in self._results if each.panel != TEMPLATE)]

    def _coloured(
        self, request: SurfaceRequest, progress: Progress | None, should_stop: ShouldStop | None
    ) -> SurfaceResult:
        """A surface with numbers on it; they come with the exact one, those of a change with previews too."""
        opened, member, _ = self._who(request.atlas, request.person)
        assert member is not None
        if request.panel.kind == "scan":
            result = _scanned(request, member)
        else:
            shape = self.surface(replace(request, panel=FULL_SHAPE, before=None), progress, should_stop)
            if request.panel.kind == "certainty":
                result = _with_certainty(replace(shape, request=request), member)
            else:
                result = self._changed(replace(shape, request=request), member, progress, should_stop)
        if result.is_exact:
            self._remember(opened, request, result)
        return result

    def _changed(
        self,
        shape: SurfaceResult,
        member: Member,
        progress: Progress | None,
        should_stop: ShouldStop | None,
    ) -> SurfaceResult:
        """With the way that corresponding points have come; plain while there are only coarse previews."""
        request = shape.request
        assert request.before is not None
        path, (person, values) = request.atlas, request.before
        if not len(shape.faces):
            return shape
        for each in {request.person, person} if shape.is_exact else ():
            self.prepare_previews(path, each, progress, should_stop)
        (_, _, tracker), (_, _, earlier) = self._who(path, request.person), self._who(path, person)
        if tracker is None or earlier is None:
            return shape
        first = later = self._tracked_before(path, person, values, earlier)
        before_mm = first.points_mm
        if shape.origin is Origin.NETWORK:
            later = self._track(request, tracker)
            moved_mm = first.points_mm - later.points_mm
            before_mm = shape.points_mm + _nearest(later.points_mm, moved_mm, shape.points_mm)
        return replace(
            shape,
            colouring=members.change(member, before_mm, shape.points_mm, shape.normals),
            volume_before_cm3=self._volume_before_cm3(request, first, tracker.faces),
            doubtful=shape.doubtful or not (first.is_trustworthy and later.is_trustworthy),
        )

    def _tracked_before(self, path: Path, person: int, values: Named, tracker: Tracker) -> Tracked:
        kept = self._before
        if kept is not None and kept[:3] == (path, person, values):
            return kept[3]
        tracked = tracker.track(dict(values))
        self._before = (path, person, values, tracked)
        return tracked

    def _volume_before_cm3(self, request: SurfaceRequest, first: Tracked, faces: NDArray[np.int64]) -> float:
        """Of the same kind as the later volume: both exact, or both of previews."""
        from naisr_model.surface.volume import enclosed_volume

        assert request.before is not None
        if request.resolution < EXACT_RESOLUTION:
            return enclosed_volume(first.points_mm, first.normals, faces) / 1000
        person, values = request.before
        before = replace(request, panel=FULL_SHAPE, person=person, values=values, before=None)
        return self.surface(before).volume_cm3

    def _track(self, request: SurfaceRequest, tracker: Tracker) -> Tracked:
        """Carry the template, beginning where the panel's last preview ended."""
        key = (request.atlas, request.person, request.panel)
        tracked = tracker.track(dict(request.values), self._tracked.get(key))
        if tracked.is_trustworthy:
            with self._lock:
                self._tracked[key] = tracked
        return tracked


@contextlib.contextmanager
def _held(lock: Lock, should_stop: ShouldStop | None) -> Iterator[None]:
    """The lock, unless it is asked to stop while it waits for it."""
    while not lock.acquire(timeout=POLL_S):
        if should_stop is not None and should_stop():
            raise Cancelled
    try:
        if should_stop is not None and should_stop():
            raise Cancelled
        yield
    finally:
        lock.release()


def _template(path: Path) -> SurfaceRequest:
    return SurfaceRequest(path, TEMPLATE, (), EXACT_RESOLUTION)


def simplest(request: SurfaceRequest, covariates: tuple[Covariate, ...]) -> SurfaceRequest:
    """The request with the fewest covariates that has the same surface as ``request``.

    g_i vanishes where covariate i is at its centre, so Phi with a single covariate off its centre is
    that covariate's Phi_i, and with none it is the template T, whoever it is.
    """
    if request.panel.kind in COLOURED:
        return request
    centre = {covariate.name: covariate.centre for covariate in covariates}
    moved = tuple((name, value) for name, value in request.values if value != centre[name])
    if len(moved) > 1:
        return replace(request, panel=FULL_SHAPE, values=moved)
    if moved:
        return replace(request, panel=Panel("effect", moved[0][0]), values=moved)
    return replace(request, panel=TEMPLATE, values=(), person=0)


def _mesh(
    atlas: Atlas,
    request: SurfaceRequest,
    latent: NDArray[np.float64] | None,
    tracker: Tracker | None,
    progress: Progress | None,
    should_stop: ShouldStop | None,
) -> trimesh.Trimesh:
    panel, size = request.panel, request.resolution
    if panel.kind == "template":
        return atlas.template(size, progress=progress, should_stop=should_stop)
    if panel.kind == "effect":
        ((name, value),) = request.values
        return atlas.effect(
            name, value, latent, size, tracker=tracker, progress=progress, should_stop=should_stop
        )
    return atlas.shape(
        dict(request.values), latent, size, tracker=tracker, progress=progress, should_stop=should_stop
    )


def _scanned(request: SurfaceRequest, member: Member) -> SurfaceResult:
    """The scan, at rest with its distance to the shape."""
    start, is_exact = time.perf_counter(), request.resolution >= EXACT_RESOLUTION
    colouring = members.distances(member, request.values) if is_exact else None
    scan = member.scan
    return SurfaceResult(
        request=request,
        points_mm=scan.points_mm,
        normals=scan.normals,
        faces=scan.faces,
        volume_cm3=scan.volume_cm3 or 0.0,
        seconds=time.perf_counter() - start,
        origin=Origin.NETWORK,
        colouring=colouring,
    )


def _with_certainty(shape: SurfaceResult, member: Member) -> SurfaceResult:
    if not shape.is_exact or not len(shape.faces):
        return shape
    return replace(shape, colouring=members.certainty(member, shape.request.values, shape.points_mm))


def _nearest(
    places: NDArray[np.float32], values: NDArray[np.float32], points: NDArray[np.float32]
) -> NDArray[np.float32]:
    """The value at the nearest of ``places [n, 3]`` for each of ``points [m, 3]``."""
    from scipy.spatial import cKDTree

    result: NDArray[np.float32] = values[cKDTree(places).query(points)[1]]
    return result


def _tracked_result(
    request: SurfaceRequest, tracker: Tracker, tracked: Tracked, start: float
) -> SurfaceResult:
    from naisr_model.surface.volume import enclosed_volume

    return SurfaceResult(
        request=request,
        points_mm=tracked.points_mm,
        normals=tracked.normals,
        faces=tracker.faces,
        volume_cm3=enclosed_volume(tracked.points_mm, tracked.normals, tracker.faces) / 1000.0,
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
    from naisr_model.surface.volume import enclosed_volume

    empty = len(mesh.faces) == 0
    points_mm = np.zeros((0, 3)) if empty else np.asarray(mesh.vertices)
    normals = np.zeros((0, 3)) if empty else np.asarray(mesh.vertex_normals)
    faces = np.asarray(mesh.faces, dtype=np.int64).reshape(-1, 3)
    return SurfaceResult(
        request=request,
        points_mm=points_mm.astype(np.float32),
        normals=normals.astype(np.float32),
        faces=faces,
        volume_cm3=enclosed_volume(points_mm, normals, faces) / 1000.0,
        seconds=time.perf_counter() - start,
        origin=Origin.NETWORK,
    )
