"""The one change of frame in the project: millimetres to the unitless box that the networks see.

Names carry the frame: ``points_mm`` are millimetres in the aligned (anatomical) frame,
``points`` without a suffix are model units, where the population fits in ``[-1, 1]^dim``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from naisr_model import records

SCALES_MM = (1e-6, 1e9)
"""Millimetres that a model unit may have, from far below to far above what anatomy has."""

UNITS_MM = {"millimetres": 1.0, "metres": 1000.0, "centimetres": 10.0, "inches": 25.4, "micrometres": 0.001}
"""What the lengths in a file may be in."""

BOX_MARGIN = 1.15
"""How much wider than the widest shape the box is; far-field samples live in the margin."""


@dataclass(frozen=True)
class Frame:
    """A constant shift and scale, the same for every shape so that size is preserved.

    Attributes:
        centre_mm: the point in millimetres that becomes the model origin, ``dim`` numbers.
        scale_mm: millimetres per model unit.
    """

    centre_mm: tuple[float, ...]
    scale_mm: float

    @property
    def dim(self) -> int:
        """2 for curves in the plane, 3 for surfaces."""
        return len(self.centre_mm)

    def to_model(self, points_mm: ArrayLike) -> NDArray[np.float64]:
        """``[..., dim]`` millimetres to ``[..., dim]`` model units."""
        return (np.asarray(points_mm, dtype=np.float64) - self.centre_mm) / self.scale_mm

    def to_mm(self, points: ArrayLike) -> NDArray[np.float64]:
        """``[..., dim]`` model units to ``[..., dim]`` millimetres."""
        return np.asarray(points, dtype=np.float64) * self.scale_mm + self.centre_mm

    def to_json(self) -> dict[str, Any]:
        """A plain dictionary that :meth:`from_json` reads back."""
        return {"centre_mm": list(self.centre_mm), "scale_mm": self.scale_mm}

    @classmethod
    def from_json(cls, record: dict[str, Any]) -> Frame:
        """The inverse of :meth:`to_json`.

        Raises:
            ValueError: for what that never gives.
        """
        dim = len(records.entry(record, "centre_mm", list))
        centre_mm, scale_mm = records.numbers(record, "centre_mm", dim), records.number(record, "scale_mm")
        if dim not in (2, 3):
            raise ValueError(f"the centre of the frame has {dim} coordinates")
        if not SCALES_MM[0] <= scale_mm <= SCALES_MM[1] or np.abs(centre_mm).max() > SCALES_MM[1]:
            raise ValueError(f"a frame of {scale_mm:g} mm a unit about {np.round(centre_mm, 3).tolist()} mm")
        return cls(tuple(map(float, centre_mm)), scale_mm)


def enclosing_frame(lower_mm: ArrayLike, upper_mm: ArrayLike) -> Frame:
    """The frame whose box ``[-1, 1]^dim`` holds the given bounds with :data:`BOX_MARGIN` to spare.

    Args:
        lower_mm: the smallest coordinates over the whole population, ``[dim]``.
        upper_mm: the largest ones, ``[dim]``.
    """
    lower, upper = np.asarray(lower_mm, float), np.asarray(upper_mm, float)
    half = float((upper - lower).max()) / 2
    return Frame(tuple(map(float, (lower + upper) / 2)), half * BOX_MARGIN)
