"""How a long act tells how far it is, and learns that nobody waits for it any more.

One value goes all the way down, from the window or the command line to the loop that does the work:

>>> def squares(numbers, progress=SILENT):
...     return [number**2 for number, _ in progress.over(numbers)]
>>> told = []
>>> squares([1, 2], Progress(told.append))
[1, 4]
>>> told
[0.5, 1.0]
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from typing import TypeVar

from naisr_model.errors import Cancelled

T = TypeVar("T")


def _ignore(_share: float) -> None: ...


def _never() -> bool:
    return False


@dataclass(frozen=True, eq=False)
class Progress:
    """The share of some work that is done, as a part of a larger whole.

    Attributes:
        told: called with the finished share of the whole, 0 to 1.
        is_unwanted: asked now and then whether nobody waits for the work any more.
        start: share of the whole that is done before this work begins.
        extent: share of the whole that this work is.
    """

    told: Callable[[float], object] = _ignore
    is_unwanted: Callable[[], bool] = _never
    start: float = 0.0
    extent: float = 1.0

    def tell(self, share: float) -> None:
        """Say which share of this work is done, 0 to 1."""
        self.told(self.start + self.extent * share)

    def check(self) -> None:
        """Go on only while somebody waits.

        Raises:
            Cancelled: when nobody does.
        """
        if self.is_unwanted():
            raise Cancelled

    def part(self, start: float, end: float) -> Progress:
        """That of a piece which takes this work from one share, 0 to 1, to another."""
        return replace(self, start=self.start + self.extent * start, extent=self.extent * (end - start))

    def over(self, items: Collection[T]) -> Iterator[tuple[T, Progress]]:
        """Each of ``items`` with the progress of its own piece, all pieces being equal.

        Raises:
            Cancelled: before the next item, when nobody waits any more.
        """
        for number, item in enumerate(items):
            self.check()
            yield item, self.part(number / len(items), (number + 1) / len(items))
            self.tell((number + 1) / len(items))

    @property
    def quiet(self) -> Progress:
        """One that tells nothing and stops when this one does."""
        return replace(self, told=_ignore)


SILENT = Progress()
"""Of work that tells nobody and cannot be stopped."""
