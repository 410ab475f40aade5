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
class Extent:
    """What a shape encloses: a volume in space, an area in the plane.

    Attributes:
        title: ``volume`` or ``area``.
        unit: that it is told in.
        suffix: the unit in names of records, as in ``volume_cm3``.
        per_unit: units of length, to the power of the dimension, that make one unit of it.
    """

    title: str
    unit: str
    suffix: str
    per_unit: float

    def of(self, shape: Any) -> float:
        """What the triangles or segments of a shape in millimetres enclose."""
        return float(shape.volume) / self.per_unit

    def key(self, *what: str) -> str:
        """The name in records: ``volume_cm3``; of something else in its unit ``volume_low_cm3``."""
        return "_".join((self.title, *what, self.suffix))

    def told(self, value: float, decimals: int = 1) -> str:
        """For people: ``46.7 cm³``, and an area in three digits or more."""
        return f"{value:.{decimals}f} {self.unit}" if self.title == "volume" else f"{value:.4g} {self.unit}"


SPACE = Extent("volume", "cm³", "cm3", 1000.0)
"""Of surfaces in millimetres."""


@dataclass(frozen=True)
class Frame:
    """A constant shift and scale, the same for every shape so that size is preserved.

    Attributes:
        centre_mm: the point in millimetres that becomes the model origin, ``dim`` numbers.
        scale_mm: millimetres per model unit.
        unit: of length; other than millimetres for curves whose lengths are no millimetres, and what is
            called millimetres is this unit then.
    """

    centre_mm: tuple[float, ...]
    scale_mm: float
    unit: str = "mm"

    @property
    def dim(self) -> int:
        """2 for curves in the plane, 3 for surfaces."""
        return len(self.centre_mm)

    @property
    def extent(self) -> Extent:
        """What shapes enclose, and in which unit that is told."""
        if self.dim == 3:
            return SPACE
        return Extent("area", f"{self.unit}²", f"{self.unit}2", 1.0)

    def length(self, length_mm: float, decimals: int = 1) -> str:
        """A length for people: ``1.3 mm``; three digits in another unit, whose size nobody knows."""
        if self.unit == "mm":
            return f"{length_mm:,.{decimals}f} mm"
        return f"{length_mm:.3g} {self.unit}"

    def to_model(self, points_mm: ArrayLike) -> NDArray[np.float64]:
        """``[..., dim]`` millimetres to ``[..., dim]`` model units."""
        return (np.asarray(points_mm, dtype=np.float64) - self.centre_mm) / self.scale_mm

    def to_mm(self, points: ArrayLike) -> NDArray[np.float64]:
        """``[..., dim]`` model units to ``[..., dim]`` millimetres."""
        return np.asarray(points, dtype=np.float64) * self.scale_mm + self.centre_mm

    def to_json(self) -> dict[str, Any]:
        """A plain dictionary that :meth:`from_json` reads back."""
        stated = {} if self.unit == "mm" else {"unit": self.unit}
        return {"centre_mm": list(self.centre_mm), "scale_mm": self.scale_mm, **stated}

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
        unit = records.entry({"unit": "mm", **record}, "unit", str)
        if dim == 3 and unit != "mm":
            raise ValueError(f"a frame in space whose unit is '{unit}'")
        return cls(tuple(map(float, centre_mm)), scale_mm, unit)


def enclosing_frame(lower_mm: ArrayLike, upper_mm: ArrayLike, unit: str = "mm") -> Frame:
    """The frame whose box ``[-1, 1]^dim`` holds the given bounds with :data:`BOX_MARGIN` to spare.

    Args:
        lower_mm: the smallest coordinates over the whole population, ``[dim]``.
        upper_mm: the largest ones, ``[dim]``.
        unit: of length, for curves.
    """
    lower, upper = np.asarray(lower_mm, float), np.asarray(upper_mm, float)
    half = float((upper - lower).max()) / 2
    return Frame(tuple(map(float, (lower + upper) / 2)), half * BOX_MARGIN, unit)
