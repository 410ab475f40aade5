"""Closed curves in the plane from a user's own files: points in order, drawings and label images.

:func:`is_curve_file` tells them by their content, :func:`sound_curve` reads one and refuses what bounds no
part of the plane, as :mod:`naisr_model.data.meshes` does for surfaces. In files and in the program y grows
upwards; drawings and images, where it grows downwards, are turned over.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from naisr_model.data import formats, sheets
from naisr_model.data.drawings import read_drawing
from naisr_model.data.points import POINT_ENDINGS, read_points
from naisr_model.data.remarks import Remark
from naisr_model.errors import InputError
from naisr_model.numerals import LARGEST
from naisr_model.shapes.curve import Curve, closed

ENDINGS = (".svg", ".csv", ".txt", ".png", ".tif", ".tiff")
"""Usual endings of files of curves."""

FEWEST_VERTICES, MOST_VERTICES = 8, 100_000
"""Of a curve."""

OPEN_GAP = 3.0
"""A polygon whose ends are farther apart than so many of its longest sides was left open."""

FLAT_SHARE = 1e-4
"""Least area, as a share of that of the circle of the same length."""

UNITS_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4, "um": 0.001, "µm": 0.001}
"""Units of length that files state, in millimetres."""

_START = 4096
_IMAGES = (b"\x89PNG\r\n\x1a\n", b"II*\0", b"MM\0*")

Points = NDArray[np.float64]


class CurveFile(NamedTuple):
    """What was read from the file of a curve.

    Attributes:
        curve: in the unit that was read.
        remarks: what is odd about it, and what was set right.
        unit_mm: what was multiplied by to have millimetres; None where the file states no unit.
    """

    curve: Curve
    remarks: tuple[Remark, ...]
    unit_mm: float | None


def is_curve_file(path: str | Path) -> bool:
    """Whether a file holds a curve: a drawing, an image, or text of points with two coordinates."""
    path = Path(path)
    content = formats.content_of(path)
    plain = formats.plain(content)
    if content.startswith(_IMAGES) or formats.is_drawing(plain):
        return True
    is_text = path.suffix.lower() in POINT_ENDINGS and not formats.format_of(plain, path.suffix.lower()[1:])
    return is_text and _is_flat_text(plain)


def _is_flat_text(content: bytes) -> bool:
    """Whether the first line names x and y and no z, or holds two cells."""
    names = [name for name, _ in _header(content)]
    return ({"x", "y"} <= set(names) and "z" not in names) or (len(names) == 2 and "x" not in names)


def _header(content: bytes) -> list[tuple[str, str]]:
    """The cells of a text's first line as names and units, small letters."""
    lines = (line.strip() for line in content[:_START].decode("utf-8", "replace").splitlines())
    first = next((line for line in lines if line and not line.startswith("#")), "")
    cells = re.split(r"\s*[,;\t|]\s*|\s+(?![\[(])", first)
    titles = (sheets.split_title(cell.strip('"')) for cell in cells)
    return [(name.lower(), unit.lower()) for name, unit in titles]


def sound_curve(path: str | Path, label: int | str | None = None) -> CurveFile:
    """Read a curve, set right what can be set right, and refuse what bounds no part of the plane.

    Args:
        path: an SVG drawing; text of points (CSV, TXT) with columns x and y, in order, and ``piece`` where
            there are several polygons; or a label image (PNG, TIFF).
        label: which label of an image, its number; may be left out where there is only one.

    Raises:
        InputError: when the file cannot be read or the curve is open, crosses itself or encloses nothing.
    """
    path = Path(path)
    content = formats.content_of(path)
    if content.startswith(_IMAGES):
        loops, unit_mm, said = _image_loops(path, label), None, _ONE_PIXEL
    elif label is not None:
        raise InputError(f"{path.name} is no label image, so label {label} cannot be chosen; leave it out")
    elif formats.is_drawing(formats.plain(content)):
        drawing = read_drawing(path.name, formats.plain(content))
        loops, unit_mm, said = drawing.loops, UNITS_MM.get(drawing.unit), _unit_remark(drawing.unit)
    else:
        loops, unit = _text_loops(path, dict(_header(formats.plain(content))))
        unit_mm, said = UNITS_MM.get(unit), _unit_remark(unit)
    curve, remarks = _sound(path.name, [(unit_mm or 1.0) * loop for loop in loops])
    return CurveFile(curve, (said, *remarks), unit_mm)


_ONE_PIXEL = Remark("fine", "units", "a pixel of the image counts as one unit of length")


def _unit_remark(unit: str) -> Remark:
    if unit in UNITS_MM:
        return Remark("fine", "units", f"the file states {unit}, which were read as millimetres")
    return Remark("fine", "units", "the file states no unit of length; its numbers are taken as they are")


def _text_loops(path: Path, units: Mapping[str, str]) -> tuple[list[Points], str]:
    """Each polygon, and the unit of a text whose columns, if they are named, have these units."""
    unit = units.get("x", "")
    if "piece" not in units:
        return [read_points(path, ("x", "y"))], unit
    rows = read_points(path, ("x", "y", "piece"))
    return [rows[rows[:, 2] == piece, :2] for piece in np.unique(rows[:, 2])], unit


def labels_in(path: Path) -> dict[int, str]:
    """A title for each label of an image, none for 0.

    Raises:
        InputError: when the file is no label image.
    """
    pixels = _labels(path)
    numbers, counts = np.unique(pixels[pixels != 0], return_counts=True)
    return {int(n): f"{n}: {count:,} pixels" for n, count in zip(numbers, counts, strict=True)}


def is_image(path: Path) -> bool:
    """Whether a file is an image, by its content."""
    return formats.content_of(path).startswith(_IMAGES)


MOST_LABELS = 64
"""An image with more different values is a picture."""


def _labels(path: Path) -> NDArray[np.integer]:
    """The pixels of a label image, rows from the top."""
    from skimage import io  # takes a second

    try:
        pixels = np.asarray(io.imread(path))
    except Exception as error:  # the readers raise whatever they like on damaged files
        raise InputError(f"{path.name} cannot be read as an image; export it again") from error
    if pixels.ndim == 3 and pixels.shape[2] in (3, 4) and (pixels[..., :3] == pixels[..., :1]).all():
        pixels = pixels[..., 0]
    if pixels.ndim != 2:
        raise InputError(f"{path.name} is a colour image or a stack; save one channel of labels")
    if pixels.dtype.kind == "f" and (pixels == np.round(pixels)).all():
        pixels = pixels.astype(np.int64)
    if pixels.dtype.kind not in "iub" or len(np.unique(pixels)) > MOST_LABELS:
        raise InputError(f"{path.name} holds shades, not labels; segment the image and save its labels")
    return np.asarray(pixels.astype(np.int64))


def _image_loops(path: Path, label: int | str | None) -> list[Points]:
    """The outlines of one label through the middles between its pixels and others'."""
    from skimage.measure import find_contours

    pixels = _labels(path)
    there = np.unique(pixels[pixels != 0]).tolist()
    listed = ", ".join(map(str, there[:8])) + (" …" if len(there) > 8 else "")
    if not there:
        raise InputError(f"{path.name} holds no label; every pixel is 0")
    if label is None and len(there) > 1:
        raise InputError(f"{path.name} holds the labels {listed}; choose one, as --label {there[0]}")
    wanted = there[0] if label is None else _number(label)
    if wanted not in there:
        raise InputError(f"{path.name} has no label {label}; it holds {listed}")
    height = len(pixels)
    found = find_contours(np.pad(pixels == wanted, 1).astype(np.float64), 0.5)
    return [np.stack([loop[:, 1] - 0.5, height + 0.5 - loop[:, 0]], axis=1) for loop in found]


def _number(label: int | str) -> int | None:
    try:
        return int(label)
    except ValueError:
        return None


# --- what is wrong with it ----------------------------------------------------------------------


def _sound(name: str, loops: Sequence[Points]) -> tuple[Curve, tuple[Remark, ...]]:
    if any(not (np.abs(loop) <= LARGEST).all() for loop in loops):
        raise InputError(f"{name} has a coordinate that is no number or beyond {LARGEST:g}; export it again")
    kept = [_without_doubles(loop) for loop in loops]
    for loop in kept:
        _refuse_open(name, loop)
    kept = [loop for loop in kept if len(loop) > 2]
    if (count := sum(map(len, kept))) < FEWEST_VERTICES:
        raise InputError(f"{name} has {count} points that differ; give at least {FEWEST_VERTICES} in order")
    if count > MOST_VERTICES:
        raise InputError(f"{name} has {count:,} points; thin the curve to {MOST_VERTICES:,}")
    curve = closed(kept)
    if (place := crossing(curve)) is not None:
        where = f"({place[0]:.4g}, {place[1]:.4g})"
        raise InputError(f"{name} crosses itself near {where}; give the points in order, once round")
    if curve.volume < FLAT_SHARE * curve.area**2 / (4 * np.pi):
        raise InputError(f"{name} encloses no area; give a closed curve")
    return curve, tuple(_oddities(curve, sum(map(len, loops)) - count))


def _without_doubles(loop: Points) -> Points:
    """A polygon without points that repeat the one before, its first at its end included."""
    if not len(loop):
        return loop
    return np.asarray(loop[(loop != np.roll(loop, 1, axis=0)).any(axis=1)])


def _refuse_open(name: str, loop: Points) -> None:
    if len(loop) < FEWEST_VERTICES:
        return
    sides = np.linalg.norm(np.diff(loop, axis=0), axis=1)
    gap = float(np.linalg.norm(loop[0] - loop[-1]))
    if gap > OPEN_GAP * sides.max():
        raise InputError(
            f"{name} is open: it ends {gap:.3g} from where it begins, its sides are {np.median(sides):.3g} "
            "long; close it"
        )


def _oddities(curve: Curve, dropped: int) -> list[Remark]:
    found = []
    if (pieces := curve.pieces) > 1:
        sentence = f"the curve has {pieces} pieces"
        found.append(Remark("look", "components", sentence, "check that the others are no debris"))
    if dropped > 1:
        found.append(Remark("fine", "points", f"{dropped} points that repeat the one before were dropped"))
    return found


def crossing(curve: Curve) -> Points | None:
    """Where two segments of a curve cross, ``[2]``; None where none do.

    Only segments whose middles lie within the longest one of each other can.
    """
    begin, end = (curve.vertices[curve.faces[:, side]] for side in (0, 1))
    middles, steps = (begin + end) / 2, end - begin
    pairs = cKDTree(middles).query_pairs(1.0001 * float(curve.lengths.max()), output_type="ndarray")
    i, j = pairs[
        ~(curve.faces[pairs[:, 0]][:, :, None] == curve.faces[pairs[:, 1]][:, None]).any(axis=(1, 2))
    ].T
    apart, normal = begin[j] - begin[i], _turned(steps[j])
    pace = (steps[i] * normal).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        along_i = (apart * normal).sum(axis=1) / pace
        along_j = (apart * _turned(steps[i])).sum(axis=1) / pace
        meet = (along_i >= 0) & (along_i <= 1) & (along_j >= 0) & (along_j <= 1)
    first = np.flatnonzero(meet)[:1]
    return None if not len(first) else begin[i[first[0]]] + along_i[first[0]] * steps[i[first[0]]]


def _turned(steps: Points) -> Points:
    return np.stack([steps[:, 1], -steps[:, 0]], axis=1)
