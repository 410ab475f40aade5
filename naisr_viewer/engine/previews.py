"""Whose previews are fast, and where each of them was left."""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

from naisr_viewer.engine import surfaces
from naisr_viewer.state.layouts import Panel
from naisr_viewer.state.patients import Named
from naisr_viewer.state.requests import SurfaceRequest, SurfaceResult

if TYPE_CHECKING:
    from naisr_model.surface.tracking import Tracked, Tracker

KEPT_TRACKERS = 4
"""How many persons' previews stay fast; each takes about 35 MB, the average's 20."""


class Previews:
    """Trackers by atlas and person, and the positions from which they go on; any thread may ask."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._trackers: OrderedDict[tuple[Path, int], Tracker] = OrderedDict()
        self._tracked: dict[tuple[Path, int, Panel], Tracked] = {}
        self._before: tuple[Path, int, Named, Tracked] | None = None  # what changes were last counted from
        self._last: SurfaceResult | None = None  # sub-plots may show the same surface

    def tracker(self, path: Path, person: int) -> Tracker | None:
        """What carries the template for a person.

        None before :meth:`keep`, after :meth:`forget`, and when newer ones took the place.
        """
        return self._trackers.get((path, person))

    def keep(self, path: Path, person: int, tracker: Tracker) -> None:
        """Have a tracker for a person, at the cost of the oldest one where there are too many."""
        with self._lock:
            self._trackers[path, person] = tracker
            while len(self._trackers) > KEPT_TRACKERS:
                self._trackers.popitem(last=False)

    def forget(self, is_meant: Callable[[Path, int], bool]) -> None:
        """All of these persons, by atlas and number."""
        with self._lock:
            self._last = self._before = None
            for key in [key for key in self._trackers if is_meant(*key)]:
                del self._trackers[key]
            for panel_key in [key for key in self._tracked if is_meant(*key[:2])]:
                del self._tracked[panel_key]

    def surface(self, request: SurfaceRequest, tracker: Tracker) -> SurfaceResult:
        """The preview that answers ``request``; equal requests in a row share one."""
        start, preview = time.perf_counter(), self._last
        if preview is None or preview.request != request:
            preview = surfaces.from_tracked(request, tracker, self.track(request, tracker), start)
            self._last = preview
        return preview

    def track(self, request: SurfaceRequest, tracker: Tracker) -> Tracked:
        """Carry the template, beginning where the last preview of the same surface ended."""
        key = (request.atlas, request.person, request.panel)
        tracked = tracker.track(dict(request.values), self._tracked.get(key))
        if tracked.is_trustworthy:
            with self._lock:
                self._tracked[key] = tracked
        return tracked

    def track_before(self, path: Path, person: int, values: Named, tracker: Tracker) -> Tracked:
        """Carry the template to where changes are counted from; that stays the same for long."""
        kept = self._before
        if kept is not None and kept[:3] == (path, person, values):
            return kept[3]
        tracked = tracker.track(dict(values))
        self._before = (path, person, values, tracked)
        return tracked
