"""Requests to results: asks the atlases that are open, and remembers their answers. Knows no Qt."""

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

from naisr_model.errors import Cancelled, InputError
from naisr_model.files import replacing
from naisr_viewer.engine import cache, members, surfaces
from naisr_viewer.engine.members import Member
from naisr_viewer.engine.previews import Previews
from naisr_viewer.state.explorer import FULL_SHAPE, TEMPLATE, AtlasCard
from naisr_viewer.state.requests import (
    EXACT_RESOLUTION,
    HAS_TWO_SIDES,
    Origin,
    Progress,
    ShouldStop,
    SurfaceRequest,
    SurfaceResult,
    simplest,
    template_request,
)

if TYPE_CHECKING:
    import trimesh

    from naisr_model.atlas import Atlas
    from naisr_model.surface.displacements import DisplacementTables
    from naisr_model.surface.tracking import Tracked, Tracker

CACHED_SURFACES = 96
"""How many surfaces are kept; an exact one takes about 3 MB."""

POLL_S = 0.05
"""Between two looks at ``should_stop`` while another thread prepares previews."""

OPEN_ATLASES = 2
"""How many atlases are kept open, so that going back to the last one is instant."""


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
        self._previews = Previews()
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
            kept = cache.read_opening(self._file(fingerprint, cache.OPENING), template_request(path))
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
        self._previews.forget(is_meant)
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
        atlas, shown = self.atlas(path), self.surface(template_request(path), None, should_stop)
        if not len(shown.faces):
            return
        if not opened.was_kept:
            self._keep_opening(opened, shown)
        template = trimesh.Trimesh(shown.points_mm, shown.faces, process=False)
        tracker: Tracker
        if member is None:
            tracker = atlas.tracker(template, self._tables(opened, atlas, template, progress, should_stop))
        else:
            someone = member.fit.individual
            tracker = someone.tracker(template, progress=progress, should_stop=should_stop)
        with self._lock:
            if self._opened.get(path) is opened and (not person or person in self._members):
                self._previews.keep(path, person, tracker)

    def has_previews(self, path: Path, person: int = 0) -> bool:
        """Whether :meth:`prepare_previews` is done for a person."""
        return self._previews.tracker(path, person) is not None

    def _who(self, path: Path, person: int) -> tuple[Opened, Member | None, Tracker | None]:
        """Whom a request is about; nobody asks any more for an atlas or a person that is not there."""
        with self._lock:
            opened, member = self._opened.get(path), self._members.get(person)
            if opened is None or (person and member is None):
                raise Cancelled
            return opened, member, self._previews.tracker(path, person)

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
        if request.panel.kind in HAS_TWO_SIDES:
            return self._coloured(request, progress, should_stop)
        opened, member, tracker = self._who(request.atlas, request.person)
        question = simplest(request, opened.card.covariates)
        if tracker is not None and request.resolution < EXACT_RESOLUTION:
            return replace(self._previews.surface(request, question, tracker), request=request)
        atlas = self.atlas(request.atlas)
        start = time.perf_counter()
        latent = None if member is None else member.at(question.values).latent
        mesh = surfaces.mesh(atlas, question, latent, tracker, progress, should_stop)
        if should_stop is not None and should_stop():
            raise Cancelled
        result = surfaces.from_mesh(question, mesh, start)
        if member is not None and question.person and result.is_exact:
            margin_cm3 = member.at(question.values).volume_margin_cm3(mesh)
            result = replace(result, volume_margin_cm3=margin_cm3)
        if tracker is not None and len(result.faces):
            error_mm = surfaces.deviation_mm(self._previews.track(request, tracker).points_mm, result)
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
            result = surfaces.from_scan(request, member)
        else:
            shape = self.surface(replace(request, panel=FULL_SHAPE, before=None), progress, should_stop)
            if request.panel.kind == "certainty":
                result = surfaces.with_certainty(replace(shape, request=request), member)
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
        first = later = self._previews.track_before(path, person, values, earlier)
        before_mm = first.points_mm
        if shape.origin is Origin.NETWORK:
            later = self._previews.track(request, tracker)
            moved_mm = first.points_mm - later.points_mm
            before_mm = shape.points_mm + surfaces.at_nearest(later.points_mm, moved_mm, shape.points_mm)
        return replace(
            shape,
            colouring=members.change(member, before_mm, shape.points_mm, shape.normals),
            volume_before_cm3=self._volume_before_cm3(request, first, tracker.faces),
            doubtful=shape.doubtful or not (first.is_trustworthy and later.is_trustworthy),
        )

    def _volume_before_cm3(self, request: SurfaceRequest, first: Tracked, faces: NDArray[np.int64]) -> float:
        """Of the same kind as the later volume: both exact, or both of previews."""
        assert request.before is not None
        if request.resolution < EXACT_RESOLUTION:
            return surfaces.volume_cm3(first.points_mm, first.normals, faces)
        person, values = request.before
        before = replace(request, panel=FULL_SHAPE, person=person, values=values, before=None)
        return self.surface(before).volume_cm3


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
