"""Where the camera stands, in a window of any size."""

from __future__ import annotations

from dataclasses import dataclass

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Camera:
    """A view of the shapes, without perspective.

    Attributes:
        position_mm: where it stands.
        focus_mm: what it looks at.
        up: which way is up.
        framed_mm: width and height of what it was framed on, as seen.
        zoom: height of a sub-plot over the height that shows just that; 0.5 is twice as near.
    """

    position_mm: Triple
    focus_mm: Triple
    up: Triple
    framed_mm: tuple[float, float]
    zoom: float = 1.0


FROM_THE_FRONT = Camera((0.0, -1.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 1.0))
