"""What is told of the place under the mouse."""

from __future__ import annotations

from collections.abc import Sequence

from naisr_viewer.words.numbers import MILLIMETRES


def readout(title: str, point_mm: Sequence[float], number: str = "", unit: str = MILLIMETRES) -> str:
    """Where it is in the frame of the atlas, and the number there.

    ``Age only: +1.31 mm at 12.3, −4.0, 5.1 mm``.

    Args:
        title: of the view.
        point_mm: x, y and, in space, z.
        number: what the surface has there, with its unit; empty for nothing.
        unit: of length; other than of millimetres there are three decimals.
    """
    decimals = 1 if unit == MILLIMETRES else 3
    place = ", ".join(f"{each:.{decimals}f}" for each in point_mm) + f" {unit}"
    return f"{title}: " + (f"{number} at {place}" if number else place).replace("-", "−")


def number(value: float, unit: str, is_signed: bool) -> str:
    """With its unit, and digits that mean something: ``+1.31 mm``, ``0.0042 mm per month``."""
    digits = 2 if abs(value) >= 0.095 or value == 0 else 4
    return f"{round(value, digits) + 0.0:{'+' if is_signed else ''}.{digits}f} {unit}"
