"""PLY, as text and binary: polygons of any size, strips, and further lists that are passed over."""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from naisr_model.data.readers.parts import (
    C_TYPES,
    NO_FACES,
    Parts,
    check_indices,
    cut_off,
    from_strips,
    numbers_of,
    trailing,
    triangulated,
)
from naisr_model.errors import InputError

_TYPES = C_TYPES | {
    "uchar": "u1",
    "ushort": "u2",
    "uint": "u4",
    "int8": "i1",
    "int16": "i2",
    "int32": "i4",
    "int64": "i8",
    "uint8": "u1",
    "uint16": "u2",
    "uint32": "u4",
    "uint64": "u8",
    "float32": "f4",
    "float64": "f8",
}
_CORNERS = ("vertex_indices", "vertex_index")
_LISTED = ("vertex", "range_grid", "material")
"""Elements that have lists and are no faces."""

_BYTE_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}


class _Property(NamedTuple):
    """A number, or a list of them where ``length`` is the type of its length."""

    name: str
    type: str
    length: str = ""


class _Element(NamedTuple):
    name: str
    rows: int
    properties: tuple[_Property, ...]


class _Columns(NamedTuple):
    """Of one element: numbers by property ``[rows]``; of each list its lengths ``[rows]`` and its values."""

    rows: int
    numbers: dict[str, NDArray[np.float64]]
    lists: dict[str, tuple[NDArray[np.int64], NDArray[np.float64]]]


def read(name: str, content: bytes) -> Parts:
    """Read a PLY file.

    Raises:
        InputError: when its header is not understood, or it is cut off.
    """
    order, elements, start = _header(name, content)
    source = _Text(content, start) if not order else _Binary(content, start, order)
    found = {element.name: _columns(name, source, element) for element in elements}
    _refuse_unknown(name, elements)
    points = _points(name, found.get("vertex"))
    faces = [_polygons(name, points, found.get("face")), _strips(found.get("tristrips"))]
    check_indices(name, faces[1], len(points))
    lines = len(next(iter(found["edge"].numbers.values()), ())) if "edge" in found else 0
    return Parts(points, np.concatenate(faces), lines, trailing(source.left()))


def _header(name: str, content: bytes) -> tuple[str, list[_Element], int]:
    """The byte order, empty for text; the elements; and where the numbers begin."""
    end = re.search(rb"^[ \t]*end_header[ \t]*(\r\n|\n|\r)", content, re.MULTILINE) or re.search(
        rb"[\r\n]end_header[ \t]*(\r\n|\n|\r)", content
    )
    if end is None:
        raise InputError(f"{name} is cut off: its header has no end; copy or export it again")
    order, elements = None, list[_Element]()
    for line in re.split(r"\r\n|\n|\r", content[: end.start()].decode("latin-1")):
        words = line.split()
        try:
            if words[:1] == ["format"]:
                order = "" if words[1] == "ascii" else _BYTE_ORDERS[words[1]]
            elif words[:1] == ["element"]:
                elements.append(_Element(words[1], _count(words[2]), ()))
            elif words[:1] == ["property"]:
                last = elements.pop()
                elements.append(last._replace(properties=(*last.properties, _property(words[1:]))))
        except (KeyError, IndexError, ValueError):
            raise InputError(
                f"{name}: the header line '{line[:60]}' is not understood; export it again"
            ) from None
    if order is None:
        raise InputError(f"{name} does not say its format (ascii or binary); export it again")
    return order, elements, end.end()


def _refuse_unknown(name: str, elements: Sequence[_Element]) -> None:
    """Lists that are not known may be the faces under another name: then it is no cloud of points."""
    names = {element.name for element in elements if element.rows}
    strange = [
        each.name for each in elements if each.rows and any(column.length for column in each.properties)
    ]
    if not names & {"face", "tristrips"} and (unknown := [each for each in strange if each not in _LISTED]):
        raise InputError(
            f"{name} has no faces and lists that are not known ('{unknown[0]}'); export it again"
        )


def _count(word: str) -> int:
    count = int(word)
    if count < 0:
        raise ValueError
    return count


def _property(words: Sequence[str]) -> _Property:
    if words[0] == "list":
        return _Property(words[3], _TYPES[words[2]], _TYPES[words[1]])
    return _Property(words[1], _TYPES[words[0]])


class _Source(Protocol):
    """Numbers in a row, taken from the front; :class:`EOFError` where there are too few."""

    at: int

    def table(self, rows: int, types: Sequence[str]) -> NDArray[np.float64]:
        """Look at ``[rows, len(types)]`` numbers without taking them."""
        ...

    def take(self, rows: int, types: Sequence[str]) -> None: ...

    def row(self, properties: Sequence[_Property]) -> list[list[float]]: ...

    def left(self) -> int: ...


class _Text:
    def __init__(self, content: bytes, start: int) -> None:
        words = content[start:].split()
        try:
            self._numbers = numbers_of(words)
        except ValueError:
            self._numbers = self._until_a_word(words)
        self._words, self.at = words, 0

    @staticmethod
    def _until_a_word(words: Sequence[bytes]) -> NDArray[np.float64]:
        numbers = []
        for word in words:
            try:
                numbers.append(float(word))
            except ValueError:
                break
        return np.array(numbers)

    def table(self, rows: int, types: Sequence[str]) -> NDArray[np.float64]:
        size = rows * len(types)
        if self.at + size > len(self._numbers):
            raise EOFError
        return self._numbers[self.at : self.at + size].reshape(rows, len(types))

    def take(self, rows: int, types: Sequence[str]) -> None:
        self.at += rows * len(types)

    def row(self, properties: Sequence[_Property]) -> list[list[float]]:
        at, values = self.at, []
        for each in properties:
            if at >= len(self._numbers):
                raise EOFError
            size = int(self._numbers[at]) if each.length else 1
            at += bool(each.length)
            if size < 0 or at + size > len(self._numbers):
                raise EOFError
            values.append(self._numbers[at : at + size].tolist())
            at += size
        self.at = at
        return values

    def left(self) -> int:
        return sum(map(len, self._words[self.at :]))


class _Binary:
    def __init__(self, content: bytes, start: int, order: str) -> None:
        self._content, self.at, self._order = content, start, order
        self._codes = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q"}
        self._codes |= {"f4": "f", "f8": "d"}

    def _type(self, types: Sequence[str]) -> np.dtype:
        return np.dtype([(f"c{i}", self._order + each) for i, each in enumerate(types)])

    def table(self, rows: int, types: Sequence[str]) -> NDArray[np.float64]:
        row = self._type(types)
        if self.at + rows * row.itemsize > len(self._content):
            raise EOFError
        table = np.frombuffer(self._content, row, rows, self.at)
        return np.stack([table[column].astype(np.float64) for column in table.dtype.names or ()], axis=1)

    def take(self, rows: int, types: Sequence[str]) -> None:
        self.at += rows * self._type(types).itemsize

    def row(self, properties: Sequence[_Property]) -> list[list[float]]:
        at, values = self.at, []
        for each in properties:
            size = 1
            if each.length:
                (length,), at = self._unpacked(each.length, 1, at)
                size = int(length)
                if size < 0:
                    raise EOFError
            numbers, at = self._unpacked(each.type, size, at)
            values.append(list(numbers))
        self.at = at
        return values

    def _unpacked(self, code: str, size: int, at: int) -> tuple[tuple[float, ...], int]:
        layout = f"{self._order}{size}{self._codes[code]}"
        end = at + struct.calcsize(layout)
        if end > len(self._content):
            raise EOFError
        return struct.unpack_from(layout, self._content, at), end

    def left(self) -> int:
        return len(self._content[self.at :].strip(b"\r\n"))


def _columns(name: str, source: _Source, element: _Element) -> _Columns:
    """Take an element's rows, at once where all are of one length."""
    if not element.rows or not element.properties:
        return _Columns(element.rows, {each.name: np.zeros(0) for each in element.properties}, {})
    start = source.at
    try:
        return _even(source, element) or _uneven(source, element)
    except EOFError:
        source.at = start
        held = _rows_held(source, element)
        raise cut_off(name, f"rows of '{element.name}'", element.rows, held) from None


def _rows_held(source: _Source, element: _Element) -> int:
    """How many rows there are until the file ends; one by one, since they may differ in length."""
    for held in range(element.rows):
        try:
            source.row(element.properties)
        except EOFError:
            return held
    return element.rows


def _even(source: _Source, element: _Element) -> _Columns | None:
    """The rows if each is laid out as the first, else None."""
    lengths = _first_lengths(source, element)
    types = list[str]()
    for each, length in zip(element.properties, lengths, strict=True):
        types += [each.length, *[each.type] * length] if each.length else [each.type]
    try:
        table = source.table(element.rows, types)
    except EOFError:
        return None
    numbers, lists, column = {}, {}, 0
    for each, length in zip(element.properties, lengths, strict=True):
        if not each.length:
            numbers[each.name] = table[:, column]
            column += 1
            continue
        if (table[:, column] != length).any():
            return None
        values = table[:, column + 1 : column + 1 + length].ravel()
        lists[each.name] = (np.full(element.rows, length, np.int64), values)
        column += 1 + length
    source.take(element.rows, types)
    return _Columns(element.rows, numbers, lists)


def _first_lengths(source: _Source, element: _Element) -> list[int]:
    """How many numbers each property has in the first row."""
    start = source.at
    lengths = [len(values) for values in source.row(element.properties)]
    source.at = start
    return lengths


def _uneven(source: _Source, element: _Element) -> _Columns:
    rows = [source.row(element.properties) for _ in range(element.rows)]
    numbers, lists = {}, {}
    for column, each in enumerate(element.properties):
        parts = [row[column] for row in rows]
        values = np.array([value for part in parts for value in part], np.float64)
        if each.length:
            lists[each.name] = (np.array([len(part) for part in parts], np.int64), values)
        else:
            numbers[each.name] = values
    return _Columns(element.rows, numbers, lists)


def _points(name: str, vertex: _Columns | None) -> NDArray[np.float64]:
    numbers = {key.lower(): values for key, values in (vertex.numbers if vertex else {}).items()}
    if not {"x", "y", "z"} <= numbers.keys():
        raise InputError(f"{name} has no vertices with x, y and z; export it again")
    return np.stack([numbers[axis] for axis in "xyz"], axis=1)


def _polygons(name: str, points: NDArray[np.float64], face: _Columns | None) -> NDArray[np.int64]:
    lists = {} if face is None else face.lists
    corners = next((lists[key] for key in _CORNERS if key in lists), None)
    if corners is None:
        if face is not None and face.rows:
            raise InputError(f"{name} has faces without a list of vertices ({_CORNERS[0]}); export it again")
        return NO_FACES
    lengths, indices = corners
    if len(lengths) > 1 and not lengths[-2:].any():
        raise InputError(f"{name} was not copied whole: its last faces have no corners; copy it again")
    kept = lengths >= 3
    return triangulated(name, points, lengths[kept], indices.astype(np.int64)[np.repeat(kept, lengths)])


def _strips(strips: _Columns | None) -> NDArray[np.int64]:
    """Lists of corners, or one for all strips, parted by -1."""
    if strips is None or not strips.lists:
        return NO_FACES
    lengths, indices = next(iter(strips.lists.values()))
    found = []
    for part in np.split(indices.astype(np.int64), np.cumsum(lengths)[:-1]):
        found += [piece[piece >= 0] for piece in np.split(part, np.flatnonzero(part < 0))]
    return from_strips([strip for strip in found if len(strip) >= 3])
