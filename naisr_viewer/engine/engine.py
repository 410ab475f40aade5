"""Requests to results: asks the atlases that are open, and remembers their answers."""

from __future__ import annotations

import contextlib
from collections import OrderedDict
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

from naisr_model.errors import Cancelled
from naisr_model.progress import SILENT, Progress
from naisr_viewer.engine.answers.base import Who
from naisr_viewer.engine.answers.kinds import ANSWERS
from naisr_viewer.engine.atlases import Atlases, Opened, Read, load_atlas
from naisr_viewer.engine.cache import Cache, Opening, cache_folder, fingerprint_of, first_picture
from naisr_viewer.engine.norms import KnownNorms
from naisr_viewer.engine.people import FittedPerson
from naisr_viewer.engine.previews import Previews
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.layouts import TEMPLATE
from naisr_viewer.state.requests import Origin, SurfaceRequest, SurfaceResult

if TYPE_CHECKING:
    import trimesh

    from naisr_model.atlas import Atlas
    from naisr_model.measures.curves import Gauge
    from naisr_model.measures.norms import Norms
    from naisr_model.surface.displacements import DisplacementTables
    from naisr_model.surface.tracking import Tracker

CACHED_SURFACES = 96
"""How many surfaces are kept; an exact one takes about 3 MB."""

POLL_S = 0.05
"""Between two looks at whether anybody still waits, while another thread prepares previews."""


class Engine:
    """Answers surface requests, remembering the recent answers; any thread may ask.

    Args:
        load: reads an atlas file; raises :class:`~naisr_model.errors.InputError` on one it cannot use.
        folder: where to keep what saves time in the next run; the user's own cache when left out.
    """

    def __init__(self, load: Callable[[Path], Atlas] = load_atlas, folder: Path | None = None) -> None:
        self._cache = Cache(folder or cache_folder())
        self._atlases = Atlases(load, self._cache)
        self._lock, self._preparing = Lock(), Lock()
        self._people: dict[int, FittedPerson] = {}
        self._persons = count(1)
        self._results: OrderedDict[SurfaceRequest, SurfaceResult] = OrderedDict()
        self.previews = Previews()
        self._usual = KnownNorms(self._cache)

    def open(self, path: Path) -> AtlasCard:
        """Read ``path`` afresh and describe it.

        Raises:
            InputError: when there is no such file or it is not an atlas.
        """
        return self.begin(self.read(path))

    def read(self, path: Path) -> Read:
        """What :meth:`begin` opens: a file read afresh; what is open stays so.

        Raises:
            InputError: when there is no such file or it is not an atlas.
        """
        return self._atlases.read(path)

    def begin(self, read: Read) -> AtlasCard:
        """Have an atlas open that was read, and describe it; whoever was fitted to its file is forgotten."""
        opened, atlas = read
        with self._lock:  # what belongs to another file is gone before anybody can ask of this one
            closed = self._atlases.begin(opened, atlas)
            self._people = {key: each for key, each in self._people.items() if each.atlas not in closed}
            self._forget_surfaces(lambda atlas, _: atlas in closed)
            self._usual.forget(closed)
            if opened.picture is not None:
                self._results[opened.picture.request] = opened.picture
        return opened.card

    def card_of(self, path: Path) -> AtlasCard:
        """Describe an atlas file; unless exactly that is open, it is opened. Who was fitted stays known.

        Raises:
            InputError: when there is no such file or it is not an atlas.
        """
        with contextlib.suppress(Cancelled):
            if (open_already := self._atlases[path]).fingerprint == fingerprint_of(path):
                return open_already.card
        return self.open(path)

    def was_kept(self, path: Path) -> bool:
        """Whether the first picture of an open atlas came from the cache."""
        return self._atlases[path].picture is not None

    def atlas(self, path: Path) -> Atlas:
        """The networks of an open atlas, loaded when they are first needed.

        Raises:
            InputError: when the file has been replaced since it was opened.
        """
        return self._atlases.network(path)

    def gauge(self, path: Path) -> Gauge:
        """What measures the shapes of an open atlas.

        Raises:
            InputError: where there is nothing to measure, or the file has been replaced since it was opened.
        """
        return self._usual.gauge(self._atlases[path], self.atlas(path))

    def known_norms(self, path: Path) -> Norms | None:
        """What is usual among the people of an open atlas, once :meth:`norms` has found it; instant."""
        return self._usual.known(self._atlases[path])

    def norms(self, path: Path, progress: Progress = SILENT) -> Norms:
        """What is usual among the people of an open atlas: from the disk, or in the better part of a minute.

        Raises:
            InputError: when they are too few or all alike, where the model folds, or when the file has been
                replaced since it was opened.
            Cancelled: when nobody waits any more.
        """
        return self._usual.find(self._atlases[path], self.atlas(path), progress)

    def admit(self, fitted: FittedPerson) -> int:
        """Answer for someone who was fitted, too; returns the number that requests name the person by."""
        with self._lock:
            person = next(self._persons)
            self._people[person] = fitted
        return person

    @property
    def persons(self) -> frozenset[int]:
        """Everyone who was fitted and is not forgotten."""
        return frozenset(self._people)

    def dismiss(self, person: int) -> None:
        """Forget someone."""
        with self._lock:
            self._people.pop(person, None)
            self._forget_surfaces(lambda _, number: number == person)

    def who(self, path: Path, person: int) -> Who:
        """Whom a request is about.

        Raises:
            Cancelled: for an atlas or a person that is not there: nobody asks for them any more.
        """
        opened = self._atlases[path]
        with self._lock:
            fitted = self._people.get(person)
        if person and fitted is None:
            raise Cancelled
        return Who(opened.card, fitted, self.previews.tracker(path, person))

    def cached(self, request: SurfaceRequest) -> SurfaceResult | None:
        """The answer, if it is remembered; instant."""
        question = self._question(request)
        with self._lock:
            result = self._results.get(question)
            if result is None:
                return None
            self._results.move_to_end(question)
        return replace(result, request=request)

    def surface(self, request: SurfaceRequest, progress: Progress = SILENT) -> SurfaceResult:
        """Answer ``request``.

        Raises:
            Cancelled: when nobody waits any more.
            InputError: when the values are outside the atlas, or its file has been replaced since it was
                opened.
        """
        if (remembered := self.cached(request)) is not None:
            return remembered
        opened, question = self._atlases[request.atlas], self._question(request)
        answer = ANSWERS[question.panel.kind]
        result = answer.give(self, question, progress)
        if result.is_exact or (answer.is_kept_coarse and result.origin is Origin.NETWORK):
            self._remember(opened, result)
        return replace(result, request=request)

    def has_previews(self, path: Path, person: int = 0) -> bool:
        """Whether :meth:`prepare_previews` is done for a person."""
        return self.previews.tracker(path, person) is not None

    def prepare_previews(self, path: Path, person: int = 0, progress: Progress = SILENT) -> None:
        """Make previews of a person fast: tabulate the displacements, or read them from the disk.

        The disk holds those of the population average; what the next run shows first is kept with them.
        Where there are no displacements to tabulate, previews stay coarse; those of curves are fast anyway.

        Raises:
            Cancelled: when nobody waits any more.
            InputError: when the file has been replaced since it was opened.
        """
        with _held(self._preparing, progress):
            if not self.has_previews(path, person):
                self._prepare(path, person, progress)

    def _prepare(self, path: Path, person: int, progress: Progress) -> None:
        import trimesh

        opened, fitted = self._atlases[path], self.who(path, person).fitted
        atlas, shown = self.atlas(path), self.surface(first_picture(opened.card), progress.quiet)
        if len(shown.faces) and opened.picture is None:
            self._cache.keep_opening(opened.fingerprint, Opening(opened.card, shown))
        if not len(shown.faces) or not opened.card.is_tabulated:
            return
        template = trimesh.Trimesh(shown.points_mm, shown.faces, process=False)
        tracker: Tracker
        if fitted is None:
            tracker = atlas.tracker(template, self._tables(opened, atlas, template, progress))
        else:
            tracker = fitted.fit.individual.tracker(template, progress=progress)
        with self._lock:
            if self._atlases.is_open(opened) and (not person or person in self._people):
                self.previews.keep(path, person, tracker)

    def _tables(
        self, opened: Opened, atlas: Atlas, template: trimesh.Trimesh, progress: Progress
    ) -> DisplacementTables:
        """Those on the disk for exactly this file, or new ones."""
        if (kept := self._cache.tables(opened.fingerprint)) is not None:
            return kept
        tables = atlas.tabulate(template, progress=progress)
        self._cache.keep_tables(opened.fingerprint, tables)
        return tables

    def _question(self, request: SurfaceRequest) -> SurfaceRequest:
        """What is computed and remembered for ``request``."""
        return ANSWERS[request.panel.kind].question(request, self._atlases[request.atlas].card)

    def _remember(self, opened: Opened, result: SurfaceResult) -> None:
        """Unless the atlas was opened anew, or the person dismissed, meanwhile."""
        question = result.request
        with self._lock:
            if self._atlases.is_open(opened) and (not question.person or question.person in self._people):
                self._results[question] = result
            while len(self._results) > CACHED_SURFACES:  # templates stay: all tables are made of one mesh
                del self._results[next(each for each in self._results if each.panel != TEMPLATE)]

    def _forget_surfaces(self, is_meant: Callable[[Path, int], bool]) -> None:
        """Of these persons, by atlas and number."""
        self.previews.forget(is_meant)
        for stale in [each for each in self._results if is_meant(each.atlas, each.person)]:
            del self._results[stale]


@contextlib.contextmanager
def _held(lock: Lock, progress: Progress) -> Iterator[None]:
    """The lock, unless nobody waits any more while it is waited for."""
    while not lock.acquire(timeout=POLL_S):
        progress.check()
    try:
        progress.check()
        yield
    finally:
        lock.release()
