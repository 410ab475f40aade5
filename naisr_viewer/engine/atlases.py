"""Which atlases are open."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

from naisr_model.errors import Cancelled, InputError
from naisr_model.files import require_file, stamp_of
from naisr_viewer.engine.cache import Cache, fingerprint_of
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.requests import SurfaceResult

if TYPE_CHECKING:
    from naisr_model.atlas import Atlas

OPEN_ATLASES = 2
"""How many atlases are kept open, so that going back to the last one is instant."""


def load_atlas(path: Path, device: str = "cpu") -> Atlas:
    """Read an atlas file; here, because importing the model takes over a second."""
    from naisr_model.atlas import Atlas

    return Atlas.load(path, device)


def require_device(device: str) -> None:
    """Make sure that torch can compute there: the cache may answer for networks that could not be loaded.

    Raises:
        InputError: when it cannot.
    """
    if device != "cpu":  # which is always there, and torch takes a second to be asked
        from naisr_model.models.devices import usable_device

        usable_device(device)


@dataclass(frozen=True, eq=False)
class Opened:
    """An atlas that is open; its networks may still have to be loaded.

    Attributes:
        card: what the window knows of it.
        fingerprint: of its file and this program.
        picture: its first picture, where that came from the cache.
    """

    card: AtlasCard
    fingerprint: str
    picture: SurfaceResult | None


Read = tuple[Opened, "Atlas | None"]
"""A file that was read, with its networks where they had to be loaded."""


class Atlases:
    """Opens atlases, and loads their networks when they are first needed; any thread may ask.

    Importing and loading networks takes seconds. Of an atlas that was open before, the card and the first
    picture are in the cache, so that the window does not wait for them.

    Args:
        load: reads an atlas file; raises :class:`InputError` on one it cannot use.
        cache: of earlier runs.
    """

    def __init__(self, load: Callable[[Path], Atlas], cache: Cache) -> None:
        self._load, self._cache = load, cache
        self._lock, self._loading = Lock(), Lock()
        self._opened: OrderedDict[Path, Opened] = OrderedDict()
        self._networks: dict[Path, Atlas] = {}

    def __getitem__(self, path: Path) -> Opened:
        """An open atlas; nobody asks any more for one that is not there."""
        with self._lock:
            if path not in self._opened:
                raise Cancelled
            return self._opened[path]

    def is_open(self, opened: Opened) -> bool:
        """Whether nothing has taken its place."""
        return self._opened.get(opened.card.path) is opened

    def read(self, path: Path) -> Read:
        """What :meth:`begin` takes: a file read afresh.

        Raises:
            InputError: when there is no such file or it is not an atlas.
        """
        require_file(path, "an atlas (.safetensors)")
        written = stamp_of(path)
        fingerprint = fingerprint_of(path)
        if (kept := self._cache.opening(fingerprint, path)) is not None:
            return Opened(replace(kept.card, written=written), fingerprint, kept.picture), None
        atlas = self._load(path)
        if fingerprint_of(path) != fingerprint:  # replaced meanwhile, as a training does now and then
            return self.read(path)
        people, frame = atlas.population, atlas.frame
        card = AtlasCard(path, atlas.name, atlas.covariates, people, atlas.capabilities, frame, written)
        return Opened(card, fingerprint, None), atlas

    def begin(self, opened: Opened, atlas: Atlas | None) -> list[Path]:
        """Have an atlas open in place of what was open of its file, and of what is one too many.

        Returns:
            The files of which nothing that was open before is open any more.
        """
        path, closed = opened.card.path, [opened.card.path]
        with self._lock:
            self._forget(path)
            self._opened[path] = opened
            if atlas is not None:
                self._networks[path] = atlas
            while len(self._opened) > OPEN_ATLASES:
                closed.append(next(iter(self._opened)))
                self._forget(closed[-1])
        return closed

    def network(self, path: Path) -> Atlas:
        """An open atlas with its networks.

        Raises:
            InputError: when the file has been replaced since it was opened.
            Cancelled: when it is not open any more.
        """
        with self._loading:
            opened = self[path]
            atlas = self._networks.get(path)
            if atlas is None:
                atlas = self._load(path)
                if fingerprint_of(path) != opened.fingerprint:
                    raise InputError(f"{path.name} has changed since it was opened; open it again")
                with self._lock:
                    if self.is_open(opened):
                        self._networks[path] = atlas
            return atlas

    def _forget(self, path: Path) -> None:
        self._opened.pop(path, None)
        self._networks.pop(path, None)
