"""Tables for ``naisr prepare`` as people's tools write them, and as they should not have."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from functools import cache, partial
from pathlib import Path

import numpy as np
import trimesh
from corpus import damage, shapes
from corpus.case import OUT, Case, Damage, Ending, Expected, Files, Goods, Special, within
from eggs import egg
from numpy.random import Generator

AGES = (1.0, 2.5, 3.0, 4.25, 5.0, 6.5, 7.0, 8.75)
SEXES = ("F", "M", "M", "F", "F", "M", "F", "M")
FEW = (
    *("--surface-samples", "64", "--near-samples", "64", "--uniform-samples", "64"),
    *("--workers", "1"),
)
WORDS = ("prepare", "table.csv", "--out", f"{OUT}/store", *FEW)

Row = tuple[str, ...]
HEADER: Row = ("mesh", "subject", "visit", "age [years]", "sex", "landmarks")


@cache
def mesh(number: int, factor: float = 1.0) -> bytes:
    """The egg of a row, from 0, as an STL file."""
    return shapes.stl(_egg(number).moved(factor))


@cache
def _egg(number: int) -> shapes.Shape:
    made = trimesh.creation.icosphere(subdivisions=2)
    half = np.abs(egg(AGES[number], _sign(SEXES[number])).bounds[0])
    return shapes.Shape(np.asarray(made.vertices) * half, np.asarray(made.faces).tolist())


def _sign(sex: str) -> float:
    return 1.0 if sex == "M" else -1.0


def landmarks(age: float, sex: float) -> dict[str, tuple[float, float, float]]:
    """Places on an egg, of which no motion makes others."""
    x, y, z = (20 + 2 * sex, 20.0, 20 + 2 * age)
    at = {
        "top": (0, 0, 1),
        "bottom": (0, 0, -1),
        "left": (1, 0, 0),
        "front": (0, -1, 0),
        "spot": (0.6, 0.64, 0.48),
    }
    return {name: (x * a, y * b, z * c) for name, (a, b, c) in at.items()}


def marks(number: int) -> bytes:
    """The landmarks of a row as a CSV file."""
    found = landmarks(AGES[number], _sign(SEXES[number]))
    return "\n".join(
        ["name,x,y,z", *(f"{k},{x:.4f},{y:.4f},{z:.4f}" for k, (x, y, z) in found.items()), ""]
    ).encode()


def rows(marked: bool = False) -> list[Row]:
    """The header and the rows of the good table."""
    data = [
        (f"egg{i}.stl", f"P{i}", "1", f"{AGES[i]:g}", SEXES[i], f"marks{i}.csv") for i in range(len(AGES))
    ]
    return [HEADER, *data] if marked else [row[:5] for row in [HEADER, *data]]


def csv(table: Sequence[Row], mark: str = ",", end: str = "\n") -> bytes:
    """Cells as they are, parted by a mark."""
    return "".join(mark.join(row) + end for row in table).encode()


@cache
def good() -> dict[str, bytes]:
    """Table, meshes and landmarks."""
    meshes = {f"egg{i}.stl": mesh(i) for i in range(len(AGES))}
    return {"table.csv": csv(rows()), **meshes} | {f"marks{i}.csv": marks(i) for i in range(len(AGES))}


# --- what came of it ----------------------------------------------------------------------------


def stored(folder: Path, least: int = len(AGES), without: Sequence[int] = ()) -> str:
    """What of the store differs from the truth; ``without`` are rows whose values have no truth."""
    record = json.loads((folder / OUT / "store" / "store.json").read_text())
    people = record["population"]
    names = [covariate["name"].casefold() for covariate in people["covariates"]]
    if len(people["subjects"]) < least:
        return f"{len(people['subjects'])} rows instead of {least}"
    for subject, values, place in zip(people["subjects"], people["values"], record["shapes"], strict=True):
        number = int(subject.lstrip("P"))
        got = dict(zip(names, values, strict=True))
        told = [got.get(name, value) for name, value in (("age", AGES[number]), ("sex", 0.0))]
        if number not in without and not within(1e-6, told[0], AGES[number]):
            return f"{subject} is {told[0]} years old instead of {AGES[number]}"
        if number not in without and "sex" in got and abs(told[1]) != 1:
            return f"{subject} has the sex {told[1]}"
        volume = trimesh.load_mesh(folder / OUT / "store" / "shapes" / place / "mesh.ply").volume / 1000
        if not within(0.02, volume, _egg(number).volume_cm3):
            return f"{subject} has {volume:.2f} cm³ instead of {_egg(number).volume_cm3:.2f}"
    return _sexes(
        people["subjects"], [dict(zip(names, row, strict=True)).get("sex") for row in people["values"]]
    )


def _sexes(subjects: Sequence[str], values: Sequence[float | None]) -> str:
    """All boys are of one sex and all girls of the other, whatever the levels are called."""
    pairs = {(SEXES[int(who.lstrip("P"))], value) for who, value in zip(subjects, values, strict=True)}
    return "" if None in values or len(pairs) == 2 else f"girls and boys are mixed up: {sorted(pairs)}"


# --- cases --------------------------------------------------------------------------------------


def _case(
    name: str,
    text: bytes,
    ending: Ending = "success",
    *,
    says: str = "",
    least: int = len(AGES),
    without: Sequence[int] = (),
    files: Mapping[str, bytes | Special | None] | None = None,
    words: Sequence[str] = WORDS,
    table: str = "table.csv",
    damages: Sequence[Damage] = (),
) -> Case:
    """A table beside the good meshes, and what else replaces some of those."""

    def make(goods: Goods, rng: Generator) -> Files:
        content = text
        for each in damages:
            content = each(content, rng)
        others = {key: value for key, value in goods.table.items() if key != "table.csv"}
        placed = {**others, table: content, **(files or {})}
        return {key: value for key, value in placed.items() if value is not None}

    expected = Expected(ending, partial(stored, least=least, without=without), says)
    chosen = tuple(table if word == "table.csv" else word for word in words)
    return Case("table", name, make, chosen, expected)


def changed(row: int, column: int, cell: str, table: Sequence[Row] = ()) -> list[Row]:
    """The good table with another cell."""
    cells = [list(each) for each in (table or rows())]
    cells[row][column] = cell
    return [tuple(each) for each in cells]


def added(title: str, cells: Sequence[str]) -> list[Row]:
    """The good table with one more column."""
    return [(*row, cell) for row, cell in zip(rows(), (title, *cells), strict=True)]


def _xlsx(table: Sequence[Row], *, numbers: bool = True) -> bytes:
    import openpyxl

    book = openpyxl.Workbook()
    sheet = book.active
    assert sheet is not None
    for row in table:
        sheet.append([_cell(cell) if numbers else cell for cell in row])
    file = io.BytesIO()
    book.save(file)
    return file.getvalue()


def _cell(text: str) -> str | float:
    try:
        return float(text)
    except ValueError:
        return text


def _comma(table: Sequence[Row]) -> list[Row]:
    """Numbers as much of the world writes them."""
    return [
        tuple(cell.replace(".", ",") if column == 3 else cell for column, cell in enumerate(row))
        for row in table
    ]


def _quoted(table: Sequence[Row]) -> list[Row]:
    return [tuple(f'"{cell}"' for cell in row) for row in table]


GOOD = csv(rows())
BOM = b"\xef\xbb\xbf"

_WRITTEN = [
    _case("as it is", GOOD),
    _case("semicolons", csv(rows(), ";")),
    _case("semicolons and decimal commas", csv(_comma(rows()), ";")),
    _case("tabs", csv(rows(), "\t")),
    _case("tabs and decimal commas", csv(_comma(rows()), "\t")),
    _case("tabs, .tsv", csv(rows(), "\t"), table="table.tsv"),
    _case("tabs, .txt", csv(rows(), "\t"), table="table.txt"),
    _case("bars", csv(rows(), "|"), "either"),
    _case("quoted decimal commas", csv(_quoted(_comma(rows())))),
    _case("quoted", csv(_quoted(rows()))),
    _case("UTF-8 with a mark", BOM + GOOD),
    _case("UTF-16", GOOD, damages=[damage.encoded("utf-16")]),
    _case("UTF-16, big", b"\xfe\xff" + GOOD.decode().encode("utf-16-be")),
    _case("UTF-16, semicolons", csv(_comma(rows()), ";"), damages=[damage.encoded("utf-16")]),
    _case("UTF-16 without a mark", GOOD.decode().encode("utf-16-le"), "either"),
    _case("UTF-32", GOOD, "either", damages=[damage.encoded("utf-32")]),
    _case(
        "Latin-1",
        csv(changed(0, 4, "geschlecht für alle")),
        damages=[damage.encoded("latin-1")],
        ending="either",
    ),
    _case("sep= and semicolons", b"sep=;\n" + csv(rows(), ";")),
    _case("sep= and commas", b"sep=,\r\n" + csv(rows(), end="\r\n")),
    _case("sep= and tabs", b"sep=\t\n" + csv(rows(), "\t")),
    _case("sep= after a mark", BOM + b"sep=;\r\n" + csv(rows(), ";", "\r\n")),
    _case("lines of Windows", csv(rows(), end="\r\n")),
    _case("lines of an old Mac", csv(rows(), end="\r"), "either"),
    _case("mixed ends of lines", csv(rows()[:4], end="\r\n") + csv(rows()[4:])),
    _case("no last end of line", GOOD.rstrip()),
    _case("empty lines", GOOD.replace(b"\n", b"\n\n")),
    _case("lines of separators alone", GOOD + b",,,,\n,,,,\n"),
    _case("empty trailing columns", csv(rows(), end=",,\n")),
    _case("empty trailing columns, semicolons", csv(rows(), ";", ";;;\n")),
    _case(
        "empty trailing columns in the header alone", csv(rows()[:1], end=",,\n") + csv(rows()[1:]), "either"
    ),
    _case("spaces about cells", csv(rows(), " , ")),
    _case("no-break spaces about cells", csv([tuple(f"{c}\u00a0" for c in row) for row in rows()])),
    _case("capital titles", csv([("MESH", "SUBJECT", "VISIT", "age [years]", "sex"), *rows()[1:]])),
    _case("titles with capitals", csv([("Mesh", "Subject", "Visit", "Age [years]", "Sex"), *rows()[1:]])),
    _case("units in parentheses", csv(changed(0, 3, "age (years)"))),
    _case("no units", csv(changed(0, 3, "age"))),
    _case("another order", csv([row[::-1] for row in rows()])),
    _case("no visits", csv([row[:2] + row[3:] for row in rows()])),
    _case("a workbook", _xlsx(rows()), table="table.xlsx"),
    _case("a workbook of texts", _xlsx(rows(), numbers=False), table="table.xlsx"),
    _case("a workbook with empty rows", _xlsx([*rows(), ("", "", "", "", "")]), table="table.xlsx"),
    _case("a workbook named .csv", _xlsx(rows()), "either"),
    _case("a table named .xlsx", GOOD, "either", table="table.xlsx"),
    _case("a cut workbook", _xlsx(rows()), "refused", table="table.xlsx", damages=[damage.cut(0.6)]),
    _case("a workbook with flips", _xlsx(rows()), "either", table="table.xlsx", damages=[damage.flip(20)]),
    _case("no ending", GOOD, table="table"),
    _case("remarks in the table", b"# our first cohort\n" + GOOD, "either"),
    _case("a title line above", b"our first cohort,,,,\n" + GOOD, "either"),
]
_CELLS = [
    _case("6.50 for 6.5", csv(changed(6, 3, "6.50"))),
    _case("6.5e0 for 6.5", csv(changed(6, 3, "6.5e0"))),
    _case("+6.5", csv(changed(6, 3, "+6.5"))),
    _case("7.0 beside 7", csv(changed(7, 3, "7.0"))),
    _case("leading zeros", csv(changed(7, 3, "007")), "either"),
    _case("one quoted decimal comma", csv(changed(6, 3, '"6,5"')), "either"),
    _case("a thousand with an underscore", csv(changed(6, 3, "6_5")), "refused"),
    _case("other digits", csv(changed(7, 3, "٧")), "either"),
    _case("a unit in the cell", csv(changed(7, 3, "7 years")), "either"),
    _case(
        "a unit in every cell",
        csv([rows()[0], *((*r[:3], f"{r[3]} years", r[4]) for r in rows()[1:])]),
        "either",
    ),
    *(
        _case(
            f"{missing or 'blank'} for an age",
            csv(changed(3, 3, missing)),
            "either",
            least=7,
            says=r"4|age|missing",
        )
        for missing in ("", "NA", "n/a", "NaN", "-", "?", "null", "none", ".", "#N/A")
    ),
    *(
        _case(f"{code} for an age", csv(changed(3, 3, code)), least=7, says=code.lstrip("-"))
        for code in ("999", "-9", "-99", "9999")
    ),
    *(
        _case(
            f"{code} for an age that is meant",
            csv(changed(3, 3, code)),
            without=[2],
            words=(*WORDS, "--accept", "4"),
            says=code.lstrip("-"),
        )
        for code in ("999", "-9")
    ),
    _case("1e308 for an age", csv(changed(3, 3, "1e308")), "either", without=[2], least=7, says="1e"),
    _case("a mesh under two names", csv(changed(3, 0, "egg4.stl")), least=6, says="another subject"),
    _case("infinity", csv(changed(3, 3, "inf")), "refused"),
    _case("1e400", csv(changed(3, 3, "1e400")), "refused"),
    _case("a formula", csv(changed(3, 3, "=1+2")), "refused"),
    _case("an error of Excel", csv(changed(3, 3, "#DIV/0!")), "refused"),
    _case("a date", csv(changed(3, 3, "2020-03-01")), "refused"),
    _case("a word for a number", csv(changed(3, 3, "three")), "refused"),
    _case("m beside M", csv(changed(3, 4, "m")), "either"),
    _case("male beside M", csv(changed(3, 4, "male")), "either"),
    _case("three sexes", csv(changed(3, 4, "X")), "refused"),
    _case("1 and 2 for sexes", csv([rows()[0], *((*r[:4], str("FM".index(r[4]) + 1)) for r in rows()[1:])])),
    _case("one sex only", csv([rows()[0], *((*r[:4], "F") for r in rows()[1:])]), "refused"),
    _case("a column that is constant", csv(added("site", ["A"] * 8)), "refused"),
    _case("a column of names", csv(added("doctor", list("abcdefgh"))), "refused"),
    _case("a NUL", csv(changed(3, 4, "M\0")), "refused"),
    _case("a cell too many", csv(changed(3, 4, "M,x")), "refused"),
    _case("a cell too few", GOOD.replace(b"3,M\n", b"3\n"), "refused"),
    _case("an open quote", csv(changed(3, 4, '"M')), "refused"),
    _case("a cell of 200,000 letters", csv(changed(3, 4, "M" * 200_000)), "refused"),
    _case("no subject in a row", csv(changed(3, 1, "")), "refused"),
    _case("no mesh in a row", csv(changed(3, 0, "")), "either", least=7),
    _case("a visit twice", csv([*rows(), rows()[3]]), "refused"),
]
_TITLES = [
    _case("no subject", csv([row[:1] + row[2:] for row in rows()]), "refused"),
    _case("no mesh", csv([row[1:] for row in rows()]), "refused"),
    _case("no covariate", csv([row[:3] for row in rows()]), "refused"),
    _case("no header", csv(rows()[1:]), "refused"),
    _case("a header alone", csv(rows()[:1]), "refused"),
    _case("a title twice", csv(changed(0, 4, "age [years]")), "refused"),
    _case(
        "titles that differ by case", csv(added("Age", ["1", "2", "3", "4", "5", "6", "7", "8"])), "refused"
    ),
    _case("a column without a title", csv(added("", list("12345678"))), "refused"),
    _case("a = in a name", csv(changed(0, 4, "is=boy"))),
    _case("a comma in a name", csv(changed(0, 4, '"boy,girl"'))),
    _case("a way out in a name", csv(changed(0, 4, "../../evil"))),
    _case("a tag in a name", csv(changed(0, 4, "<b>sex</b>"))),
    _case("a slash in a name", csv(changed(0, 4, "boy/girl"))),
    _case("a long name", csv(changed(0, 4, "BMI percentile for age and sex " * 30)), "either"),
    _case("Chinese", csv(changed(0, 4, "性别"))),
    *(_case(what, content, "refused") for what, content in damage.STRANGERS.items()),
    _case(
        "a folder", b"", "refused", table="other.csv", words=("prepare", ".", "--out", f"{OUT}/store", *FEW)
    ),
    _case("random bytes", b"", "refused", damages=[damage.noise(0, 3000)]),
    *(
        _case(f"cut at {share}", GOOD, "either", least=0, damages=[damage.cut(share)])
        for share in (0.03, 0.3, 0.8)
    ),
    *(
        _case(f"flips {turn}", GOOD, "either", least=0, without=range(8), damages=[damage.flip(3 + turn)])
        for turn in range(6)
    ),
    *(
        _case(f"swapped blocks {turn}", GOOD, "either", least=0, without=range(8), damages=[damage.swap(9)])
        for turn in "ab"
    ),
    _case("a hole", GOOD, "either", least=0, without=range(8), damages=[damage.hole(20)]),
    _case("zeros within", GOOD, "refused", damages=[damage.zeros(20)]),
    _case("twice", GOOD, "refused", damages=[damage.doubled]),
]


def _with_path(name: str, path: str) -> Case:
    """The good table, the mesh of row 4 under a path of another kind: read, or spoken of."""
    return _case(name, csv(changed(3, 0, path)), "either", least=7, says="(?i)egg2|8 shapes")


def _with_mesh(name: str, content: bytes | Special | None, ending: Ending, says: str = "") -> Case:
    """The good table, with another mesh in row 4, which is egg 2."""
    return _case(f"mesh: {name}", GOOD, ending, files={"egg2.stl": content}, least=7, says=says)


_BOX = shapes.stl(shapes.triangles().moved(0.02, (900.0, 0.0, 0.0)) + _egg(2))
_MESHES = [
    _with_mesh("missing", None, "success", r"egg2"),
    _with_mesh("empty", b"", "success", r"egg2"),
    _with_mesh("cut", mesh(2)[: len(mesh(2)) // 2], "success", r"egg2"),
    _with_mesh("a folder", Special.FOLDER, "success", r"egg2"),
    _case("mesh: another subject's", GOOD, "either", files={"egg2.stl": mesh(3)}, least=6, says="row 4"),
    _with_mesh("in metres", mesh(2, 0.001), "either", r"egg2|row 4"),
    _with_mesh("in centimetres", mesh(2, 0.1), "either", r"egg2|row 4"),
    _with_mesh("with debris far away", _BOX, "either", r"egg2|row 4"),
    _with_mesh("far away", shapes.stl(_egg(2).moved(1.0, (0, 0, 2000.0))), "either", r"egg2|row 4"),
    _with_mesh(
        "RAS among others", shapes.stl(_egg(2).moved(1.0, (8, 5, 0)), b"SPACE=RAS"), "either", r"egg2|row 4"
    ),
    _case("mesh: inside out", GOOD, files={"egg2.stl": shapes.stl(_egg(2).turned_round())}),
    _with_mesh("ten times as large", mesh(2, 10.0), "either", r"egg2|row 4"),
    _with_mesh("not a number", shapes.stl(_egg(2).moved(np.nan)), "success", r"egg2"),
    _case("mesh: ASCII named alike", GOOD, files={"egg2.stl": shapes.stl_text(_egg(2))}),
    _case("mesh: a PLY named .stl", GOOD, files={"egg2.stl": shapes.ply(_egg(2))}),
    _with_path("paths with backslashes", ".\\egg2.stl"),
    _with_path("a path of Windows", "C:\\scans\\egg2.stl"),
    _with_path("a path with file://", "file://egg2.stl"),
    _with_path("a path with ~", "~/egg2.stl"),
    _with_path("a path in capitals", "EGG2.STL"),
    _case("paths of nothing", csv([rows()[0], *(("gone" + r[0], *r[1:]) for r in rows()[1:])]), "refused"),
    _case(
        "a mesh under three subjects",
        csv(changed(3, 0, "egg4.stl", changed(2, 0, "egg4.stl"))),
        "either",
        least=5,
        says="row 3.*\n.*row 4.*\n.*row 6",
    ),
]


def _beside(name: str, text: str | bytes | Special, ending: Ending = "refused") -> Case:
    content = text.encode() if isinstance(text, str) else text
    return _case(f"settings: {name}", GOOD, ending, files={"table.toml": content})


_SETTINGS = [
    _beside("good", 'name = "eggs"\n[covariates.sex]\nkind = "binary"\nlevels = ["F", "M"]\n', "success"),
    _beside("empty", "", "success"),
    _beside("a mark", BOM + b'name = "eggs"\n', "either"),
    _beside("UTF-16", 'name = "eggs"\n'.encode("utf-16"), "either"),
    _beside("no TOML", "name: eggs\n"),
    _beside("cut", 'name = "eggs\n'),
    _beside("an unknown table", "[shape]\nx = 1\n"),
    _beside("an unknown column", '[covariates.height]\nunit = "cm"\n'),
    _beside("a number for a name", "name = 5\n"),
    _beside("a list for covariates", "covariates = [1, 2]\n"),
    _beside("one level", '[covariates.sex]\nlevels = ["F"]\n'),
    _beside("levels that are not there", '[covariates.sex]\nlevels = ["cat", "dog"]\n'),
    _beside("levels in other words", '[covariates.sex]\nlevels = ["girl", "boy"]\n', "either"),
    _beside("levels of lists", "[covariates.sex]\nlevels = [[1], [2]]\n"),
    _beside("an unknown kind", '[covariates.age]\nkind = "ordinal"\n'),
    _beside("a number of two values", '[covariates.age]\nkind = "binary"\n'),
    _beside("another unit", '[covariates.age]\nunit = "months"\n'),
    _beside("an unknown alignment", '[alignment]\nmethod = "magic"\n'),
    _beside("alignment without landmarks", '[alignment]\nmethod = "landmarks"\n'),
    _beside("a date in the source", "[source]\nday = 2020-01-01\n"),
    _beside("a folder", Special.FOLDER, "either"),
    _beside("flips", b"name = 'eggs'\n[covariates.sex]\nkind = 'binary'\nlevels = ['F', 'M']\x00\n"),
]
CASES = (*_WRITTEN, *_CELLS, *_TITLES, *_MESHES, *_SETTINGS)
