"""Curves as the bytes of a file, and whatever shape as those of the file that its name asks for."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from naisr_model.exports import MeshFormat, mesh_bytes
from naisr_model.shapes.curve import Curve

WRITTEN = 12
"""Digits of a coordinate."""

MEASURED = 7
"""Digits of what is known at a vertex."""


def shape_bytes(shape: Any, ending: str, unit: str = "mm") -> bytes:
    """A surface or a curve as the content of a file.

    Args:
        shape: in millimetres, a curve in ``unit``.
        ending: of the file, as :func:`~naisr_model.exports.require_format` gives it.
        unit: of length.
    """
    if ending == "csv":
        return csv_bytes(shape)
    return svg_bytes(shape, unit) if ending == "svg" else mesh_bytes(shape, cast(MeshFormat, ending))


def csv_bytes(curve: Curve, numbers: Mapping[str, NDArray[np.floating]] = MappingProxyType({})) -> bytes:
    """The curve as text: a line x,y,piece a vertex, each polygon closed by its first vertex being meant.

    Args:
        curve: in any unit.
        numbers: what else is known at the vertices, ``[n]``, by the name of its column.
    """
    lines = [",".join(["x", "y", "piece", *numbers])]
    for number, loop in enumerate(curve.loops, start=1):
        known = [values[loop].tolist() for values in numbers.values()]
        for (x, y), *more in zip(curve.vertices[loop].tolist(), *known, strict=True):
            told = [f"{each:.{MEASURED}g}" for each in more]
            lines.append(",".join([f"{x:.{WRITTEN}g}", f"{y:.{WRITTEN}g}", str(number), *told]))
    return ("\n".join(lines) + "\n").encode()


def svg_bytes(curve: Curve, unit: str) -> bytes:
    """The curve as a drawing; y, which grows upwards here and downwards there, is turned over.

    Millimetres are said to be such; of other units the numbers alone are there.
    """
    (left, bottom), (right, top) = curve.bounds.tolist()
    margin = 0.02 * max(right - left, top - bottom)
    width, height = right - left + 2 * margin, top - bottom + 2 * margin
    size = f'width="{width:.6g}mm" height="{height:.6g}mm" ' if unit == "mm" else ""
    box = f'viewBox="{left - margin:.8g} {-top - margin:.8g} {width:.8g} {height:.8g}"'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {size}{box}>\n'
        f'<path transform="scale(1 -1)" fill="#d8c8b8" stroke="black" stroke-width="{width / 400:.3g}" '
        f'd="{path_data(curve)}"/>\n</svg>\n'
    ).encode()


def path_data(curve: Curve) -> str:
    """The polygons as the data of an SVG path."""
    return " ".join(
        "M" + " L".join(f"{x:.{WRITTEN}g},{y:.{WRITTEN}g}" for x, y in curve.vertices[loop].tolist()) + " Z"
        for loop in curve.loops
    )
