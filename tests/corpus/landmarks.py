"""Files of landmarks, for an alignment of one scan and of a whole table."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np
from corpus import damage, shapes, tables
from corpus.case import RECORD, Case, Damage, Ending, Expected, Files, Goods
from corpus.fits import KNOWN
from numpy.random import Generator

KIND = "landmarks"
MARKS = tables.landmarks(6.0, 1.0)
Marks = Mapping[str, tuple[float, float, float]]

_TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
_SHIFT_MM = np.array([40.0, -30.0, 500.0])


def _moved(points: np.ndarray) -> np.ndarray:
    return points @ _TURN.T + _SHIFT_MM


SCAN = shapes.Shape(_moved(shapes.triangles().points), shapes.triangles().polygons)
"""The egg as it lies in a scanner."""

HERE: Marks = {name: tuple(_moved(np.array(point)).tolist()) for name, point in MARKS.items()}


def text(marks: Marks, mark: str = ",", header: str = "name,x,y,z", number: str = "{:.4f}") -> bytes:
    """A line a landmark."""
    lines = [mark.join([name, *map(number.format, point)]) for name, point in marks.items()]
    return "\n".join([header.replace(",", mark), *lines, ""]).encode()


def fcsv(marks: Marks) -> bytes:
    """What 3D Slicer wrote for years."""
    head = "# Markups fiducial file version = 4.11\n# CoordinateSystem = LPS\n"
    head += "# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n"
    lines = [f"{i},{x},{y},{z},0,0,0,1,1,1,0,{name},,\n" for i, (name, (x, y, z)) in enumerate(marks.items())]
    return (head + "".join(lines)).encode()


def markups(marks: Marks, system: str = "LPS") -> bytes:
    """What 3D Slicer writes now."""
    points = [
        {"id": str(i), "label": name, "position": list(at)} for i, (name, at) in enumerate(marks.items())
    ]
    made = {"type": "Fiducial", "coordinateSystem": system, "coordinateUnits": "mm", "controlPoints": points}
    return json.dumps({"markups": [made]}).encode()


def aligned(folder: Path) -> str:
    """What is wrong with where the scan was laid: each landmark on the atlas's."""
    record = json.loads((folder / RECORD).read_text())
    matrix = np.array(record["patient"]["file_to_atlas"])
    here = np.c_[np.array(list(HERE.values())), np.ones(len(HERE))] @ matrix.T
    away = np.linalg.norm(here[:, :3] - np.array(list(MARKS.values())), axis=1).max()
    return "" if away < 0.5 else f"landmarks lie {away:.1f} mm from the atlas's"


def _scan(
    name: str,
    content: bytes,
    ending: Ending = "success",
    *damages: Damage,
    says: str = "",
    file: str = "marks.csv",
) -> Case:
    """One scan aligned by a file."""

    def make(_goods: Goods, rng: Generator) -> Files:
        marks = content
        for each in damages:
            marks = each(marks, rng)
        return {"egg.stl": shapes.stl(SCAN), file: marks}

    words = ("fit", "egg.stl", "--atlas", "{goods}/marked.safetensors", *KNOWN, "--json", RECORD)
    return Case(
        KIND,
        name,
        make,
        (*words, "--align", "landmarks", "--landmarks", file),
        Expected(ending, aligned, says),
    )


def _with(**changed: tuple[float, float, float]) -> Marks:
    return {**HERE, **changed}


_SWAPPED = {**HERE, "top": HERE["bottom"], "bottom": HERE["top"]}
_MIRRORED = {name: (-x, y, z) for name, (x, y, z) in HERE.items()}
_METRES = {name: (x / 1000, y / 1000, z / 1000) for name, (x, y, z) in HERE.items()}
_LINES = text(HERE)
_APART = r"landmarks? .*apart|apart|do not fit|mm (off|away)|far|look"
_SCANS = [
    _scan("as they are", _LINES),
    _scan("semicolons", text(HERE, ";")),
    _scan("semicolons and decimal commas", text(HERE, ";").replace(b".", b",")),
    _scan("tabs", text(HERE, "\t")),
    _scan("capital titles", text(HERE, header="Name,X,Y,Z")),
    _scan("titles with spaces", text(HERE, header="name, x, y, z")),
    _scan("quoted", b'"name","x","y","z"\n' + b"\n".join(_LINES.splitlines()[1:]) + b"\n"),
    _scan("a mark", b"\xef\xbb\xbf" + _LINES),
    _scan("UTF-16", _LINES, "success", damage.encoded("utf-16")),
    _scan("lines of Windows", _LINES.replace(b"\n", b"\r\n")),
    _scan("another order of lines", text(dict(reversed(list(HERE.items()))))),
    _scan(
        "another order of columns",
        b"x,y,z,name\n" + b"".join(f"{x},{y},{z},{n}\n".encode() for n, (x, y, z) in HERE.items()),
    ),
    _scan(
        "more columns",
        text(HERE, header="name,x,y,z,note").replace(b"\n", b",by hand\n").replace(b"note,by hand", b"note"),
    ),
    _scan("one more landmark", text(_with(ear=(1.0, 2.0, 3.0)))),
    _scan("four of five", text({k: v for k, v in HERE.items() if k != "left"})),
    _scan("empty lines", _LINES.replace(b"\n", b"\n\n")),
    _scan("names in capitals", text({k.upper(): v for k, v in HERE.items()}), "either"),
    _scan("3D Slicer's .fcsv", fcsv(HERE), "either", file="marks.fcsv"),
    _scan("3D Slicer's .mrk.json", markups(HERE), "either", file="marks.mrk.json"),
    _scan(
        "3D Slicer's .mrk.json in RAS",
        markups({k: (-x, -y, z) for k, (x, y, z) in HERE.items()}, "RAS"),
        "either",
        file="marks.mrk.json",
    ),
    _scan("a .mrk.json that is none", b"{}", "refused", file="marks.mrk.json"),
    _scan("a cut .mrk.json", markups(HERE), "refused", damage.cut(0.5), file="marks.mrk.json"),
    _scan("a name twice", _LINES + _LINES.splitlines()[1] + b"\n", "refused"),
    _scan("a name twice, elsewhere", _LINES + b"top,0,0,0\n", "refused"),
    _scan("two at the origin", text(_with(top=(0, 0, 0), left=(0, 0, 0))), "refused"),
    _scan("all at one place", text(dict.fromkeys(HERE, (1.0, 2.0, 3.0))), "refused"),
    _scan("all on a line", text({k: (float(i), 0.0, 0.0) for i, k in enumerate(HERE)}), "refused"),
    _scan("one at 1e6", text(_with(top=(1e6, 0, 0))), "refused"),
    _scan("one at 1e100", text(_with(top=(1e100, 0, 0)), number="{:g}"), "refused"),
    _scan("one at 1e308", text(_with(top=(1e308, 0, 0)), number="{:g}"), "refused"),
    _scan("nan", text(_with(top=(np.nan, 0, 0))), "refused"),
    _scan("no coordinate", _LINES.replace(b"top", b"top,,,\nup"), "refused"),
    _scan("a word", _LINES.replace(b"\ntop,", b"\ntop,near ", 1), "refused"),
    _scan("two landmarks", text({k: HERE[k] for k in ("top", "left")}), "refused"),
    _scan("others' names", text({f"a{k}": v for k, v in HERE.items()}), "refused"),
    _scan("no names", b"x,y,z\n1,2,3\n4,5,6\n7,8,9\n", "refused"),
    _scan("no header", _LINES.partition(b"\n")[2], "either"),
    *(_scan(what, content, "refused") for what, content in damage.STRANGERS.items()),
    *(_scan(f"cut at {share}", _LINES, "either", damage.cut(share)) for share in (0.1, 0.5)),
    _scan("flips in the header", _LINES, "refused", damage.flip(6, 0, 9)),
    _scan("zeros within", _LINES, "refused", damage.zeros(12)),
]


def _doubtful(name: str, content: bytes) -> Case:
    """Landmarks that no motion lays on the atlas's: refused, or accepted and spoken of."""
    case = _scan(name, content)
    return Case(KIND, name, case.make, case.words, Expected("either", says=_APART))


_DOUBTFUL = [
    _doubtful("two swapped", text(_SWAPPED)),
    _doubtful("mirrored", text(_MIRRORED)),
    _doubtful("in metres", text(_METRES)),
    _doubtful("one 60 mm off", text(_with(spot=(HERE["spot"][0] + 60, *HERE["spot"][1:])))),
]


def _row(
    name: str, content: bytes | None, says: str = "egg2|marks2|row 4", ending: Ending = "either"
) -> Case:
    """A table whose row 4 has other landmarks: told of, rejected or refused, and the rest stays as it is."""

    def make(goods: Goods, _rng: Generator) -> Files:
        files = {**goods.table, "table.csv": tables.csv(tables.rows(marked=True)), "marks2.csv": content}
        return {key: value for key, value in files.items() if value is not None}

    check = partial(tables.stored, least=7)
    return Case(KIND, f"row: {name}", make, tables.WORDS, Expected(ending, check, says))


_OWN: Marks = tables.landmarks(tables.AGES[2], 1.0)
_ROWS = [
    _row("as they are", text(_OWN), "8 shapes", "success"),
    _row("missing", None),
    _row("empty", b""),
    _row("swapped", text({**_OWN, "top": _OWN["bottom"], "bottom": _OWN["top"]})),
    _row("mirrored", text({k: (-x, y, z) for k, (x, y, z) in _OWN.items()})),
    _row("in metres", text({k: (x / 1000, y / 1000, z / 1000) for k, (x, y, z) in _OWN.items()})),
    _row("one at 1e6", text({**_OWN, "top": (1e6, 0.0, 0.0)})),
    _row("one at 1e100", text({**_OWN, "top": (1e100, 0.0, 0.0)}, number="{:g}")),
    _row("nan", text({**_OWN, "top": (np.nan, 0.0, 0.0)})),
    _row("a name twice", text(_OWN) + b"top,0,0,0\n"),
    _row("two at the origin", text({**_OWN, "top": (0.0, 0.0, 0.0), "left": (0.0, 0.0, 0.0)})),
    _row("another subject's", tables.marks(7), ""),
    _row("two landmarks", text({k: _OWN[k] for k in ("top", "left")})),
    _row("semicolons", text(_OWN, ";"), "8 shapes", "success"),
    _row("UTF-16", text(_OWN).decode().encode("utf-16"), "8 shapes", "success"),
]
CASES = (*_SCANS, *_DOUBTFUL, *_ROWS)
