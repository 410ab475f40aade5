"""What may be typed after a command."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path

import trimesh
from corpus import shapes, tables
from corpus.case import OUT, RECORD, REFUSED, Case, Expected, Files, Goods, Special, nothing, within
from corpus.checkpoints import surface
from corpus.fits import whole
from corpus.meshes import EGG
from corpus.stores import trained
from numpy.random import Generator

EITHER = Expected("either")
ATLAS = "{goods}/atlas.safetensors"
MESH = ("mesh", ATLAS, f"{OUT}/mean.stl")
MEASURE = ("measure", ATLAS)
FIT = ("fit", "egg.stl", "--atlas", ATLAS)
EVOLVE = ("evolve", "egg.stl", "--atlas", ATLAS, "--known", "age=6,sex=M", "--json", RECORD)
TRANSFER = ("transfer", "egg.stl", "--atlas", ATLAS, "--known", "age=6,sex=M", "--json", RECORD)
PREPARE = ("prepare", "table.csv", "--out", f"{OUT}/store")
TRAIN = ("train", "store", "--out", f"{OUT}/mine.safetensors", "--config", "{goods}/small.toml")


def _files(more: Mapping[str, bytes | Special]) -> Callable[[Goods, Generator], Files]:
    def make(goods: Goods, _rng: Generator) -> Files:
        egg = {"egg.stl": shapes.stl(shapes.triangles())}
        store = {f"store/{name}": content for name, content in goods.store.items()}
        return {**goods.table, **store, **egg, **more}

    return make


def _case(words: tuple[str, ...], expected: Expected = REFUSED, **more: bytes | Special) -> Case:
    files = {name.replace("_", "."): content for name, content in more.items()}
    name = " ".join(Path(word).name if word.startswith("{") else word for word in words)
    return Case("options", name, _files(files), words, expected)


def _of(command: tuple[str, ...], *endings: str, expected: Expected = REFUSED) -> list[Case]:
    """A command with each of some endings."""
    return [_case((*command, *ending.split(" ")), expected) for ending in endings]


def _steps(count: int) -> Expected:
    def check(folder: Path) -> str:
        found = json.loads((folder / RECORD).read_text())["shapes"]
        volumes = [shape["volume_cm3"] for shape in found]
        if len(found) != count:
            return f"{len(found)} shapes instead of {count}"
        return "" if all(within(0.9, volume, EGG) for volume in volumes) else f"volumes of {volumes} cm³"

    return Expected("success", check)


def _exported(name: str) -> Expected:
    def check(folder: Path) -> str:
        made = trimesh.load_mesh(folder / OUT / name)
        longest = float(max(made.extents))
        # Metres for GLB, millimetres for the others.
        return "" if 0.03 < longest < 0.1 or 30 < longest < 100 else f"the mesh is {longest} long"

    return Expected("success", check)


CASES = (
    _case((*MESH, "--set", "age=6", "--set", "sex=M", "--resolution", "32"), Expected("success", surface)),
    _case((*MESH, "--set", "age=6.0", "--set", "sex=M", "--resolution", "64"), Expected("success", surface)),
    *(
        _case(("mesh", ATLAS, f"{OUT}/mean.{ending}", "--resolution", "32"), _exported(f"mean.{ending}"))
        for ending in ("stl", "ply", "obj", "glb", "STL")
    ),
    *_of(
        MESH,
        *(
            "--set age",
            "--set age=",
            "--set =6",
            "--set age=old",
            "--set age=nan",
            "--set age=inf",
            "--set age=1e999",
        ),
        *(
            "--set age=99",
            "--set age=-5",
            "--set Age=6=7",
            "--set height=5",
            "--set sex=X",
            "--set sex=",
        ),
        *(
            "--set age=1_0",
            "--set age=5 --set age=6",
            "--set age=6months",
            "--set",
            "--set age=٦٦",
            "--set age=0x6",
        ),
        *("--resolution 0", "--resolution -8", "--resolution 12.5", "--resolution 100000", "--resolution 7"),
        *(
            "--resolution many",
            "--resolution 1e3",
            "--resolution",
            "--effect age",
            "--effect height --set height=5",
        ),
        *(
            "--effect age --set age=5 --set sex=M",
            "--effect sex --set sex=2",
            "--template --set age=5",
            "--template --effect age",
        ),
        *(
            "--device quantum",
            "--device cuda:99",
            "--colour red",
            "extra",
            "--set age=6 extra",
            "--template=maybe",
        ),
    ),
    *_of(
        MESH,
        "--effect age --set age=5 --resolution 32",
        "--template --resolution 32",
        "--resolution 32 --set age=20 --extrapolate",
        expected=Expected("success"),
    ),
    *(
        _case(("mesh", ATLAS, out))
        for out in (
            ".",
            "/",
            "",
            "mean.doc",
            "mean",
            ".stl",
            "in/../..",
            "egg.stl/mean.stl",
            "/proc/mean.stl",
            "/dev/null/mean.stl",
        )
    ),
    _case(("mesh", ATLAS, "folder.stl"), folder_stl=Special.FOLDER),
    *(
        _case(words)
        for words in (
            ("fly",),
            ("fit",),
            ("mesh",),
            ("info",),
            ("--wings",),
            ("info", ""),
            ("info", "."),
            ("info", "gone.safetensors"),
            ("info", "egg.stl"),
            ("info", "table.csv"),
            ("info", ATLAS, ATLAS),
            ("bench", "egg.stl"),
        )
    ),
    *_of(
        MEASURE,
        *("--set age=99", "--set age=nan", "--set height=5", "--set age=5 --set age=6", "--set", "extra"),
        *("--label 1", "--align icp", "--scan gone.stl", "--scan egg.stl --align magic", "--scan table.csv"),
        *("--scan egg.stl --set age=6,sex=X", "--scan egg.stl --label 1", "--json .", "--known age=6"),
    ),
    *_of(
        FIT,
        *(
            "--known age",
            "--known age=",
            "--known age=old",
            "--known age=99",
            "--known age=nan",
            "--known age=6,age=7",
        ),
        *("--known height=5", "--known sex=X", "--known age=6;sex=M", "--known =", "--known age==6"),
        *(
            "--scale 0",
            "--scale -1",
            "--scale nan",
            "--scale inf",
            "--scale big",
            "--scale 1e-300",
            "--scale 1e300",
        ),
        *(
            "--label 1",
            "--align magic",
            "--align landmarks",
            "--landmarks marks1.csv",
            "--align landmarks --landmarks gone.csv",
        ),
        *(
            "--align icp --landmarks marks1.csv",
            "--json .",
            "--json /",
            "--json egg.stl/a.json",
            "--out egg.stl",
            "--out egg.stl/a",
        ),
        *("--out /proc/fits", "--json /proc/a.json", "--wings 2"),
    ),
    _case((*FIT, "--known", "age=6, sex=M", "--json", RECORD), whole(EGG)),
    _case((*FIT, "--known", " age = 6 ,sex= M ", "--json", RECORD), whole(EGG)),
    _case((*FIT, "--known", "age=6,sex=M,", "--json", RECORD), whole(EGG)),
    _case((*FIT, "--known", "age=6.0e0,sex=M", "--json", RECORD), whole(EGG)),
    _case((*FIT, "--known", "", "--json", RECORD), whole(EGG)),
    _case((*FIT, "--scale", "1", "--json", RECORD), whole(EGG)),
    _case((*FIT, "--align", "icp", "--json", RECORD), whole(EGG)),
    _case((*FIT, "--known", "age=6,sex=m", "--json", RECORD), whole(EGG, "either")),
    _case((*FIT, "--known", 'age="6,5",sex=M', "--json", RECORD), whole(EGG, "either")),
    *(
        _case(("fit", file, "--atlas", ATLAS))
        for file in (
            "",
            ".",
            "gone.stl",
            "table.csv",
            "store",
            "/dev/null",
            "/proc/self/mem",
            "egg",
            "{goods}/atlas.safetensors",
        )
    ),
    *(
        _case(("fit", "egg.stl", "--atlas", atlas))
        for atlas in ("", ".", "gone.safetensors", "egg.stl", "store")
    ),
    *(
        _case((*EVOLVE, *more.split(" ")), _steps(count))
        for more, count in (
            ("--steps 3", 3),
            ("--steps 2 --from 4 --to 5", 2),
            ("--steps 2 --path only", 2),
            ("--steps 2 --from 6 --to 2", 2),
        )
    ),
    _case((*EVOLVE, "--path", "way.csv"), _steps(2), way_csv=b"age,sex\n4,M\n5,M\n"),
    _case((*EVOLVE, "--path", "ways.csv"), _steps(2), ways_csv=b"\xef\xbb\xbfage,sex\r\n4,M\r\n5,M\r\n"),
    *_of(
        EVOLVE,
        *(
            "--steps 0",
            "--steps -3",
            "--steps 2.7",
            "--steps many",
            "--steps 100000000",
            "--along height",
        ),
        *(
            "--along",
            "--to 99",
            "--to nan",
            "--to inf",
            "--from old",
            "--from -5",
        ),
        *("--path magic", "--path gone.csv", "--path .", "--path egg.stl", "--out egg.stl"),
    ),
    *(
        _case((*EVOLVE, "--path", f"way{number}.csv"), REFUSED, **{f"way{number}_csv": content})
        for number, content in enumerate(
            (
                b"",
                b"age,sex\n",
                b"height\n4\n5\n",
                b"age,sex\n4\n5\n",
                b"age,sex\n99,M\n5,M\n",
                b"age,sex\nnan,M\n5,M\n",
                b"age,age\n4,5\n5,6\n",
                b"\x00\x01\x02",
                b"age,sex\n4,M,9\n5,M\n",
            )
        )
    ),
    _case((*TRANSFER, "--to", "age=8"), _steps(2)),
    _case((*TRANSFER, "--to", "age=8,sex=M"), _steps(2)),
    *_of(
        TRANSFER,
        *(
            "--to",
            "--to age",
            "--to age=",
            "--to age=99",
            "--to age=old",
            "--to age=nan",
            "--to height=5",
            "--to sex=X",
            "--to =",
            "--to age=7,age=8",
            "--to age=8;sex=M",
        ),
    ),
    _case(TRANSFER),
    _case((*TRANSFER, "--to", ""), EITHER),
    *_of(EVOLVE, "--steps 1", "--along sex", "--from 4 --to 4", expected=EITHER),
    *_of(
        PREPARE,
        *(
            f"{option} {value}"
            for option, value in (
                *(
                    ("--held-out", "1"),
                    ("--held-out", "1.5"),
                    ("--held-out", "-0.1"),
                    ("--held-out", "nan"),
                    ("--held-out", "half"),
                ),
                *(
                    ("--seed", "-1"),
                    ("--seed", "1.5"),
                    ("--workers", "0"),
                    ("--workers", "-3"),
                    ("--workers", "1e9"),
                ),
                *(("--accept", "0"), ("--accept", "1"), ("--accept", "99"), ("--accept", "-1")),
                *(("--accept", "x"), ("--accept", "2.5"), ("--accept", "2-4"), ("--accept", "")),
                *(("--surface-samples", "0"), ("--near-samples", "-5"), ("--uniform-samples", "many")),
                *(
                    ("--surface-samples", "1000000000000"),
                    ("--near-samples", "1000000000000"),
                    ("--uniform-samples", "1000000000000"),
                ),
            )
        ),
    ),
    *(
        _case(("prepare", "table.csv", "--out", out, *tables.FEW))
        for out in ("table.csv", "table.csv/store", "/proc/store", "/dev/null")
    ),
    _case((*PREPARE, *tables.FEW, "--held-out", "0.99")),
    _case((*PREPARE, *tables.FEW, "--held-out", "0"), Expected("success", tables.stored)),
    *_of(
        TRAIN,
        *(
            "--epochs 0",
            "--epochs -1",
            "--epochs many",
            "--epochs 1.5",
            "--epochs 99999999999999999999",
            "--seed -1",
        ),
        *(
            "--seed 99999999999999999999999 --epochs 1",
            "--time-budget soon",
            "--time-budget 0s",
            "--time-budget -5m",
            "--time-budget infs",
        ),
        *(
            "--time-budget nanh",
            "--time-budget 5",
            "--preset huge",
            "--preset",
            "--device quantum --epochs 1",
            "--config gone.toml",
            "--config .",
        ),
    ),
    _case((*TRAIN, "--epochs", "1", "--seed", "7"), Expected("success", trained)),
    _case((*TRAIN, "--time-budget", "1s"), Expected("success", trained)),
    *(
        _case(("train", "store", "--out", out, *TRAIN[4:], "--epochs", "1"))
        for out in (
            "",
            ".",
            "/",
            "egg.stl",
            "table.csv",
            "store",
            "egg.stl/a.safetensors",
            "/proc/a.safetensors",
        )
    ),
    *(
        _case(("populate", *words.split(" ")))
        for words in (
            "moon out",
            "airway",
            f"airway {OUT}/p --patients 0",
            f"airway {OUT}/p --patients -2",
            f"airway {OUT}/p --seed -1",
            "airway egg.stl --patients 2",
            f"airway {OUT}/p --patients 1.5",
            f"airway {OUT}/p --patients 1000000000",
        )
    ),
    _case(("evaluate", "magic", ATLAS)),
    _case(("evaluate", "transfer", "egg.stl", "--store", "store")),
    _case(("evaluate", "reconstruction", ATLAS)),
    _case(("evaluate", "transfer", ATLAS, "--store", "gone")),
    _case(("evaluate", "transfer", ATLAS, "--store", "store", "--limit", "-1")),
    _case(("evaluate", "transfer", ATLAS, "--store", "store", "--limit", "0")),
    _case(("info", ATLAS), Expected("success", nothing, "eggs")),
)
