"""Closed outlines in an SVG drawing as polygons."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from naisr_model.errors import InputError

BEZIER_STEPS = 16
"""Straight pieces that a Bézier curve becomes."""

_TOKEN = re.compile(r"[A-Za-z]|[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_TRANSFORM = re.compile(r"(\w+)\s*\(([^)]*)\)")
_LENGTH = re.compile(r"\s*([0-9.eE+-]+)\s*(mm|cm|in)\s*$")
_COUNTS = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "Z": 0}

Points = NDArray[np.float64]


class Drawing(NamedTuple):
    """The outlines in a drawing.

    Attributes:
        loops: polygons ``[n, 2]`` with y upwards.
        unit: of the coordinates, where the drawing says how large it is; else empty.
    """

    loops: list[Points]
    unit: str


def read_drawing(name: str, content: bytes) -> Drawing:
    """The polygons, polylines and paths of an SVG drawing, as they are drawn.

    Args:
        name: of the file, for messages.
        content: of the file.

    Raises:
        InputError: when it is no XML, or what it draws are no outlines.
    """
    if b"<!ENTITY" in content:
        raise InputError(f"{name} declares entities, which drawings need none of; save it as plain SVG")
    try:
        root = ElementTree.fromstring(content)
    except ElementTree.ParseError as error:
        raise InputError(f"{name} is no whole SVG file ({error}); save it again") from error
    loops = [loop * [1.0, -1.0] for loop in _outlines(name, root, np.eye(3))]
    if not loops:
        raise InputError(f"{name} draws no path and no polygon; convert its shapes to paths")
    factor, unit = _scale(root)
    return Drawing([factor * loop for loop in loops], unit)


def _outlines(name: str, element: ElementTree.Element, outer: Points) -> Iterator[Points]:
    matrix = outer @ _matrix(name, element.get("transform", ""))
    tag = element.tag.rsplit("}", 1)[-1]
    if tag in ("defs", "clipPath", "mask", "symbol", "marker", "pattern"):
        return
    if tag in ("polygon", "polyline"):
        numbers = np.array([float(text) for text in _NUMBER.findall(element.get("points", ""))])
        yield _moved(numbers[: len(numbers) // 2 * 2].reshape(-1, 2), matrix)
    elif tag == "path":
        yield from (_moved(loop, matrix) for loop in _loops_of(name, element.get("d", "")))
    elif tag in ("circle", "ellipse", "rect", "line", "use"):
        raise InputError(f"{name} draws a <{tag}>; convert its shapes to paths")
    for child in element:
        yield from _outlines(name, child, matrix)


def _moved(points: Points, matrix: Points) -> Points:
    return points @ matrix[:2, :2].T + matrix[:2, 2]


def _matrix(name: str, text: str) -> Points:
    whole = np.eye(3)
    for what, inside in _TRANSFORM.findall(text):
        numbers = [float(number) for number in _NUMBER.findall(inside)]
        whole = whole @ _one_matrix(name, what, numbers)
    return whole


def _one_matrix(name: str, what: str, numbers: list[float]) -> Points:
    match what, numbers:
        case "matrix", [a, b, c, d, e, f]:
            return np.array([[a, c, e], [b, d, f], [0, 0, 1]])
        case "translate", [x, *rest]:
            return np.array([[1, 0, x], [0, 1, rest[0] if rest else 0.0], [0, 0, 1]])
        case "scale", [x, *rest]:
            return np.diag([x, rest[0] if rest else x, 1.0])
        case "rotate", [degrees]:
            cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
            return np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    raise InputError(f"{name} has the transform '{what}'; apply its transforms, or save it as plain SVG")


def _loops_of(name: str, data: str) -> Iterator[Points]:
    """The sub-paths of a path's data as polygons; Bézier curves become straight pieces."""
    tokens = _TOKEN.findall(data)
    points: list[Points] = []
    at = start = control = np.zeros(2)
    command, place = "", 0
    while place < len(tokens):
        if tokens[place].isalpha():
            command, place = tokens[place], place + 1
        letter = command.upper()
        if letter not in _COUNTS:
            raise InputError(f"{name} has the path command '{command[:10]}'; convert arcs to curves")
        try:
            numbers = np.array([float(token) for token in tokens[place : place + _COUNTS[letter]]])
        except ValueError:
            numbers = np.zeros(0)
        if len(numbers) < _COUNTS[letter]:
            raise InputError(f"{name} has a path that ends early; save it again")
        place += _COUNTS[letter]
        if letter == "Z":
            at = control = start
            if place < len(tokens) and not tokens[place].isalpha():
                raise InputError(f"{name} has numbers after the end of a path; save it again")
            continue
        base = at if command.islower() else np.zeros(2)
        if letter == "M":
            if points:
                yield np.array(points)
            at = start = control = base + numbers
            points, command = [at], "l" if command.islower() else "L"
            continue
        reached, control = _reached(letter, at, base, control, numbers)
        points += reached
        at = points[-1]
    if points:
        yield np.array(points)


def _reached(
    letter: str, at: Points, base: Points, control: Points, numbers: Points
) -> tuple[list[Points], Points]:
    """The points that one command draws through, and the control point that the next may reflect."""
    if letter in "HV":
        end = at.copy()
        end["HV".index(letter)] = base["HV".index(letter)] + numbers[0]
        return [end], end
    given = list(base + numbers.reshape(-1, 2))
    if letter == "L":
        return given, given[-1]
    if letter in "ST":
        given.insert(0, 2 * at - control)
    return _bezier(np.array([at, *given])), given[-2]


def _bezier(controls: Points) -> list[Points]:
    """Points of a Bézier curve after its first, by de Casteljau's construction."""
    shares = np.linspace(0, 1, BEZIER_STEPS + 1)[1:, None, None]
    level = np.broadcast_to(controls, (BEZIER_STEPS, *controls.shape))
    while level.shape[1] > 1:
        level = (1 - shares) * level[:, :-1] + shares * level[:, 1:]
    return list(level[:, 0])


def _scale(root: ElementTree.Element) -> tuple[float, str]:
    """What a coordinate is worth in the unit of the drawing's width; 1 where it has none."""
    width = _LENGTH.match(root.get("width", ""))
    box = [float(number) for number in _NUMBER.findall(root.get("viewBox", ""))]
    if width is None or len(box) != 4 or not box[2] > 0:
        return 1.0, ""
    return float(width[1]) / box[2], width[2]
