"""What is usual among the people of the atlases that are open: worked out once, and kept on the disk."""

from __future__ import annotations

from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

from naisr_model.progress import Progress
from naisr_viewer.engine.atlases import Opened
from naisr_viewer.engine.cache import Cache

if TYPE_CHECKING:
    from naisr_model.atlas import Atlas
    from naisr_model.measures.curves import Gauge
    from naisr_model.measures.norms import Norms


class KnownNorms:
    """By atlas, and what measures its shapes; any thread may ask.

    Args:
        cache: of earlier runs.
    """

    def __init__(self, cache: Cache) -> None:
        self._cache, self._lock = cache, Lock()
        self._gauges: dict[Path, tuple[Opened, Gauge]] = {}
        self._norms: dict[Path, tuple[Opened, Norms]] = {}

    def gauge(self, opened: Opened, atlas: Atlas) -> Gauge:
        """What measures the shapes of an atlas; the first time it takes a second.

        Raises:
            InputError: where the model deforms no template, or it has no surface.
        """
        from naisr_model.measures.curves import gauge_of

        path = opened.card.path
        if (kept := self._gauges.get(path)) is None or kept[0] is not opened:
            kept = self._gauges[path] = opened, gauge_of(atlas)
        return kept[1]

    def known(self, opened: Opened) -> Norms | None:
        """What is usual, as far as it is known; instant."""
        kept = self._norms.get(opened.card.path)
        return kept[1] if kept is not None and kept[0] is opened else None

    def find(self, opened: Opened, atlas: Atlas, progress: Progress) -> Norms:
        """What is usual: from the disk in a second, or worked out in the better part of a minute.

        Raises:
            InputError: when the people are too few or all alike, or where the model folds.
            Cancelled: when nobody waits any more.
        """
        with self._lock:
            found = self.known(opened) or self._cache.norms(opened.fingerprint, atlas)
            if found is None:
                from naisr_model.measures.norms import norms_of

                found = norms_of(atlas, progress=progress)
                self._cache.keep_norms(opened.fingerprint, found)
            self._norms[opened.card.path] = opened, found
            self._gauges[opened.card.path] = opened, found.gauge
        return found

    def forget(self, paths: list[Path]) -> None:
        """What belongs to atlases that were closed."""
        for path in paths:
            self._gauges.pop(path, None)
            self._norms.pop(path, None)
