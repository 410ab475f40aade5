"""Clouds of points as text, and landmarks."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
from corpus import damage, shapes
from corpus.case import REFUSED, Case, Damage, Expected
from corpus.fits import case, part
from numpy.typing import NDArray

KIND = "cloud"
_cloud = partial(case, KIND)


@cache
def points() -> NDArray[np.float64]:
    """On the egg, millimetres."""
    return shapes.triangles().points[::2]


def text(
    mark: str = ",",
    header: str = "",
    number: str = "{:.5f}",
    end: str = "\n",
    order: str = "xyz",
    more: str = "",
) -> bytes:
    """A line a point."""
    columns = ["xyz".index(axis) for axis in order]
    rows = [mark.join(number.format(point[i]) for i in columns) + more for point in points()]
    return end.join([*([header] if header else []), *rows, ""]).encode()


def _commas(mark: str) -> bytes:
    return text(mark).replace(b".", b",")


def _good(name: str, content: bytes, *damages: Damage, file: str = "egg.csv") -> Case:
    return _cloud(name, file, lambda: content, part(), *damages)


def _changed(row: int, line: str) -> bytes:
    lines = text().decode().splitlines()
    lines[row] = line
    return "\n".join([*lines, ""]).encode()


_TEXT = text()
_WRITTEN = [
    *(
        _good(f"{name}, {ending}", text(mark), file=f"egg.{ending}")
        for name, mark in (
            ("commas", ","),
            ("semicolons", ";"),
            ("tabs", "\t"),
            ("spaces", " "),
            ("wide spaces", "   "),
        )
        for ending in ("csv", "xyz")
    ),
    _good("capital .CSV", _TEXT, file="EGG.CSV"),
    _good("a header", text(header="x,y,z")),
    _good("a header in capitals", text(header="X,Y,Z")),
    _good("a header with units", text(header="x [mm],y [mm],z [mm]")),
    _good("a quoted header", text(header='"x","y","z"')),
    _good("another order", text(header="z,y,x", order="zyx")),
    _good("more columns", text(header="x,y,z,intensity", more=",17")),
    _good("normals", text(" ", more=" 0 0 1"), file="egg.xyz"),
    _good("numbers first", text(header="n,x,y,z").replace(b"\n", b"\n1,").removesuffix(b"1,")),
    _good("remarks", b"# by hand\n" + _TEXT),
    _good("empty lines", _TEXT.replace(b"\n", b"\n\n")),
    _good("lines of Windows", text(end="\r\n")),
    _good("no last end of line", _TEXT.rstrip()),
    _good("a mark", b"\xef\xbb\xbf" + _TEXT),
    _good("a mark and a header", b"\xef\xbb\xbf" + text(header="x,y,z")),
    _good("UTF-16", _TEXT, damage.encoded("utf-16")),
    _good("decimal commas and semicolons", _commas(";")),
    _good("decimal commas and tabs", _commas("\t")),
    _good("decimal commas, semicolons and a header", b"x;y;z\n" + _commas(";")),
    _good("sep=", b"sep=;\n" + text(";")),
    _good("commas at the end", text(more=",")),
    _good("exponents", text(number="{:.6E}")),
    _good("a remark in Latin-1", b"# R\xf6hre\n" + _TEXT),
    _good("every point twice", _TEXT + _TEXT),
    _good("metres", "\n".join(",".join(map(repr, (p / 1000).tolist())) for p in points()).encode()),
    _cloud(
        "the count first",
        "egg.xyz",
        lambda: f"{len(points())}\nan egg\n".encode() + text(" "),
        part("either"),
    ),
    _cloud("spaces within decimal commas", "egg.csv", lambda: _commas(", "), part("either")),
    _cloud("decimal commas and commas", "egg.csv", lambda: _commas(","), REFUSED),
    _cloud("UTF-16 without a mark", "egg.csv", lambda: _TEXT.decode().encode("utf-16-le"), part("either")),
]
_BROKEN = [
    *(
        _cloud(name, "egg.csv", lambda line=line: _changed(5, line), REFUSED)
        for name, line in {
            "two numbers": "1,2",
            "a word": "1,2,three",
            "nan": "nan,nan,nan",
            "inf": "1,2,inf",
            "1e308": "1,2,1e308",
            "an empty cell": "1,,3",
            "a NUL": "1,2,\x003",
        }.items()
    ),
    _cloud("a point far away", "egg.csv", lambda: _changed(5, "1,2,900000"), part("either", "far|away|from")),
    _cloud("a header without z", "egg.csv", lambda: text(header="x,y,w"), REFUSED),
    _cloud("x twice", "egg.csv", lambda: text(header="x,y,z,x", more=",99"), REFUSED),
    _cloud("two columns", "egg.csv", lambda: text(order="xy"), REFUSED),
    _cloud("ten points", "egg.csv", lambda: b"\n".join(_TEXT.splitlines()[:10]), REFUSED),
    _cloud("a header alone", "egg.csv", lambda: b"x,y,z\n", REFUSED),
    _cloud("all alike", "egg.csv", lambda: b"1,2,3\n" * 300, REFUSED),
    _cloud("on a line", "egg.csv", lambda: "".join(f"{i},0,0\n" for i in range(300)).encode(), REFUSED),
    *(
        _cloud(what, "egg.csv", lambda content=content: content, REFUSED)
        for what, content in damage.STRANGERS.items()
    ),
    *(
        _cloud(f"cut at {share}", "egg.csv", lambda: _TEXT, part("either"), damage.cut(share))
        for share in (0.01, 0.4, 0.9)
    ),
    *(_cloud(f"flips {turn}", "egg.csv", lambda: _TEXT, part("either"), damage.flip(4)) for turn in "abc"),
    _cloud("swapped blocks", "egg.csv", lambda: _TEXT, Expected("either"), damage.swap(100)),
    _cloud("zeros within", "egg.csv", lambda: _TEXT, REFUSED, damage.zeros(60)),
]
CASES = (*_WRITTEN, *_BROKEN)
