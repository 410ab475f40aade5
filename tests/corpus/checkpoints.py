"""Atlas files: damaged, contradicting themselves, and of other kinds."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from corpus import damage, shapes
from corpus.case import OUT, REFUSED, Case, Damage, Ending, Expected, Files, Goods, Special, within
from numpy.random import Generator

KIND = "checkpoint"
FILE = "eggs.safetensors"
INFO = ("info", FILE)
MESH = ("mesh", FILE, f"{OUT}/mean.stl", "--resolution", "32", "--set", "age=6", "--set", "sex=M")
FIT = ("fit", "egg.stl", "--atlas", FILE, "--known", "age=6,sex=M", "--json", f"{OUT}/record.json")
Record = dict[str, Any]


def surface(folder: Path) -> str:
    """What is wrong with the mesh of the atlas at 6 years, a boy's."""
    volume = trimesh.load_mesh(folder / OUT / "mean.stl").volume / 1000
    truth = shapes.triangles().volume_cm3
    # The lattice is coarse, and the atlas was trained for seconds.
    return "" if within(0.05, volume, truth) else f"{volume:.2f} cm³ instead of {truth:.2f}"


def _bytes(name: str, *damages: Damage, ending: Ending = "refused", words: tuple[str, ...] = MESH) -> Case:
    """The file with damaged bytes."""

    def make(goods: Goods, rng: Generator) -> Files:
        content = goods.atlas
        for each in damages:
            content = each(content, rng)
        return {FILE: content, "egg.stl": shapes.stl(shapes.triangles())}

    check = {"check": surface} if words is MESH else {}
    return Case(KIND, name, make, words, Expected(ending, **check))


def unpacked(content: bytes) -> tuple[Record, bytes]:
    """The header of a .safetensors file, and its tensors."""
    size = struct.unpack("<Q", content[:8])[0]
    return json.loads(content[8 : 8 + size]), content[8 + size :]


def packed(header: Record, body: bytes) -> bytes:
    """The file again."""
    text = json.dumps(header).encode()
    text = text.ljust(-(-len(text) // 8) * 8)
    return struct.pack("<Q", len(text)) + text + body


def _record(
    name: str, change: Callable[[Record], object], words: tuple[str, ...] = MESH, ending: Ending = "refused"
) -> Case:
    """The description of the atlas changed, and nothing that could tell so kept beside it."""

    def make(goods: Goods, _rng: Generator) -> Files:
        header, body = unpacked(goods.atlas)
        metadata = {key: header["__metadata__"][key] for key in ("format", "version", "record")}
        record = json.loads(metadata["record"])
        change(record)
        header["__metadata__"] = metadata | {"record": json.dumps(record)}
        return {FILE: packed(header, body), "egg.stl": shapes.stl(shapes.triangles())}

    check = {"check": surface} if words is MESH else {}
    return Case(KIND, f"record: {name}", make, words, Expected(ending, **check))


def _header(name: str, change: Callable[[Record], object], ending: Ending = "refused") -> Case:
    """The header of the file changed."""

    def make(goods: Goods, _rng: Generator) -> Files:
        header, body = unpacked(goods.atlas)
        change(header)
        return {FILE: packed(header, body)}

    return Case(KIND, f"header: {name}", make, INFO, Expected(ending))


def _tensor(name: str, which: int, value: float, words: tuple[str, ...] = MESH) -> Case:
    """Some numbers of one tensor replaced."""

    def make(goods: Goods, _rng: Generator) -> Files:
        header, body = unpacked(goods.atlas)
        names = sorted(key for key in header if key != "__metadata__")
        start, stop = header[names[which]]["data_offsets"]
        changed = np.frombuffer(body, "<f4").copy()
        changed[start // 4 : min(stop // 4, start // 4 + 3)] = value
        header["__metadata__"] = {key: header["__metadata__"][key] for key in ("format", "version", "record")}
        return {FILE: packed(header, changed.tobytes()), "egg.stl": shapes.stl(shapes.triangles())}

    return Case(KIND, f"tensor {which}: {name}, {words[0]}", make, words, REFUSED)


def _put(*path: str | int, value: Any) -> Callable[[Record], object]:
    """Another value at a place in the record."""

    def change(record: Record) -> None:
        place: Any = record
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = value

    return change


def _drop(*path: str | int) -> Callable[[Record], object]:
    def change(record: Record) -> None:
        place: Any = record
        for key in path[:-1]:
            place = place[key]
        del place[path[-1]]

    return change


def _nested(record: Record) -> None:
    deep: Any = 1
    for _ in range(900):
        deep = [deep]
    record["source"] = {"deep": deep}


_BYTES = [
    _bytes("as it is", ending="success"),
    _bytes("as it is, info", ending="success", words=INFO),
    _bytes("as it is, fit", ending="success", words=FIT),
    *(_bytes(f"cut at {share}", damage.cut(share)) for share in (0.0002, 0.05, 0.5, 0.8, 0.99)),
    _bytes("without its last byte", damage.short(1)),
    _bytes("a byte more", damage.ended_with(b"\0"), ending="either"),
    _bytes("twice", damage.doubled, ending="either"),
    *(_bytes(f"flips in the length {turn}", damage.flip(1, 0, 8)) for turn in "ab"),
    *(_bytes(f"flips in the header {turn}", damage.flip(2, 8, 2000), ending="either") for turn in "abcde"),
    *(_bytes(f"flips in the tensors {turn}", damage.flip(3, 4800), ending="either") for turn in "abcde"),
    _bytes("many flips", damage.flip(200)),
    _bytes("a hole", damage.hole(64)),
    _bytes("zeros in the header", lambda content, _rng: content[:100] + bytes(50) + content[150:]),
    _bytes("zeros in the tensors", lambda content, _rng: content[:-3000] + bytes(3000), ending="either"),
    _bytes("packed", damage.gzipped),
    *(
        _bytes(what, lambda _content, _rng, other=other: other, words=words)
        for what, other in damage.STRANGERS.items()
        for words in (INFO,)
    ),
    _bytes("a mesh", lambda _content, _rng: shapes.stl(shapes.triangles()), words=INFO),
    _bytes("a table", lambda _content, _rng: b"mesh,subject,age\na.stl,A,1\n", words=FIT),
    _bytes(
        "a pickle",
        lambda _content, _rng: b"\x80\x04\x8c\x05posix\x8c\x06system\x93\x8c\x0btouch pwned\x85R.",
    ),
    _bytes("a huge length", lambda content, _rng: b"\xff" * 8 + content[8:]),
    _bytes("a length of 99 MB", lambda content, _rng: struct.pack("<Q", 99_000_000) + content[8:]),
]
_HEADERS = [
    _header("another format", _put("__metadata__", "format", value="other")),
    _header("no description", _drop("__metadata__")),
    _header("an empty description", _put("__metadata__", "record", value="")),
    _header("no JSON", _put("__metadata__", "record", value="{")),
    _header("a list", _put("__metadata__", "record", value="[]")),
    _header("nesting", _put("__metadata__", "record", value="[" * 100_000 + "]" * 100_000)),
    *(
        _header(f"version {version}", _put("__metadata__", "version", value=version))
        for version in ("99", "abc", "-1", "", "1.5")
    ),
    _header("a number for a description", _put("__metadata__", "record", value="7")),
]
_POPULATION = ("population",)
_RECORDS = [
    *(
        _record(f"{'.'.join(map(str, path))} missing", _drop(*path))
        for path in (
            ("preset",),
            ("population",),
            ("frame",),
            ("alignment",),
            ("frame", "scale_mm"),
            ("population", "covariates"),
            ("population", "values"),
        )
    ),
    *(
        _record(f"a scale of {value}", _put("frame", "scale_mm", value=value))
        for value in (0, -40.0, float("nan"), float("inf"), "wide", None, 1e308)
    ),
    _record("a scale of 0, fit", _put("frame", "scale_mm", value=0), FIT),
    _record("a centre of two", _put("frame", "centre_mm", value=[0.0, 0.0])),
    _record("a centre of nan", _put("frame", "centre_mm", value=[float("nan"), 0.0, 0.0]), FIT),
    _record("no model", _drop("preset", "model"), ending="either"),
    _record("another model", _put("preset", "model", value="magic")),
    _record("a model that is a list", _put("preset", "model", value=[])),
    *(
        _record(f"{size} wide", _put("preset", "network", "template", "width", value=size))
        for size in (0, -8, 64, 10**9, "32")
    ),
    *(
        _record(f"{size} hidden", _put("preset", "network", "template", "hidden", value=size))
        for size in (-1, 5, 10**7)
    ),
    *(
        _record(f"a code of {size}", _put("preset", "network", "latent", value=size))
        for size in (0, -4, 5, 10**9)
    ),
    *(_record(f"{size} dimensions", _put("preset", "network", "dim", value=size)) for size in (0, 2, 4, 300)),
    _record("an unknown setting", _put("preset", "network", "colour", value=3)),
    _record("no covariates", _put("population", "covariates", value=[])),
    _record(
        "a covariate twice", lambda r: r["population"]["covariates"].append(r["population"]["covariates"][0])
    ),
    _record(
        "covariates in another order", lambda r: r["population"]["covariates"].reverse(), ending="either"
    ),
    _record("a covariate of scale 0", _put("population", "covariates", 0, "scale", value=0.0)),
    _record("a covariate of scale nan", _put("population", "covariates", 0, "scale", value=float("nan"))),
    _record("a covariate of centre nan", _put("population", "covariates", 0, "centre", value=float("nan"))),
    _record("a range that is reversed", _put("population", "covariates", 0, "range", value=[9.0, 1.0])),
    _record("a range of nan", _put("population", "covariates", 0, "range", value=[float("nan")] * 2)),
    _record("an unknown kind", _put("population", "covariates", 0, "kind", value="ordinal")),
    _record("one level", _put("population", "covariates", 1, "levels", value=["F"])),
    _record("a name that is a number", _put("population", "covariates", 0, "name", value=5)),
    *(
        _record(f"short {column}", _drop("population", column, 0))
        for column in ("subjects", "visits", "values", "held_out")
    ),
    _record(
        "values of one column",
        lambda r: r["population"].update(values=[[row[0]] for row in r["population"]["values"]]),
    ),
    _record("a value of nan", _put("population", "values", 0, 0, value=float("nan"))),
    _record(
        "everybody held out",
        lambda r: r["population"].update(held_out=[True] * len(r["population"]["held_out"])),
        FIT,
    ),
    _record("an unknown alignment", _put("alignment", "method", value="magic"), INFO),
    _record("an alignment of nothing", _put("alignment", value=None)),
    _record("deep nesting", _nested, INFO, "either"),
    _record("training of words", _put("training", "iterations", value="many"), INFO),
    _record("a training that is a list", _put("training", value=[1, 2]), INFO),
    _record("a name that is a list", _put("name", value=["a"]), INFO, "either"),
]
_TENSORS = [
    _tensor(f"{value}", which, value, words)
    for which, value, words in (
        *((0, np.nan, MESH), (2, np.nan, MESH), (5, np.inf, MESH), (0, np.nan, FIT), (0, np.inf, INFO)),
        *((-3, np.nan, MESH), (-3, 1e38, MESH)),
    )
]


def _shapes(name: str, change: Callable[[Record, str], object]) -> Case:
    """The first tensor announced otherwise."""

    def alter(header: Record) -> None:
        header["__metadata__"] = {key: header["__metadata__"][key] for key in ("format", "version", "record")}
        change(header, min(key for key in header if key != "__metadata__"))

    return _header(f"a tensor {name}", alter)


_ANNOUNCED = [
    _shapes("of another shape", lambda header, key: header[key].update(shape=[*header[key]["shape"], 1])),
    _shapes("of another type", lambda header, key: header[key].update(dtype="I32")),
    _shapes("of an unknown type", lambda header, key: header[key].update(dtype="F99")),
    _shapes("that overlaps", lambda header, key: header[key].update(data_offsets=[0, 4])),
    _shapes("that is missing", lambda header, key: header.pop(key)),
    _shapes("with another name", lambda header, key: header.update({"weights.x": header.pop(key)})),
    _shapes(
        "beyond the end", lambda header, key: header[key].update(data_offsets=[0, 10**15], shape=[10**14])
    ),
]


def _folder(_goods: Goods, _rng: Generator) -> Files:
    return {FILE: Special.FOLDER}


_PLACES = [Case(KIND, f"a folder, {words[0]}", _folder, words, REFUSED) for words in (INFO, MESH)]
CASES = (*_BYTES, *_HEADERS, *_RECORDS, *_TENSORS, *_ANNOUNCED, *_PLACES)
