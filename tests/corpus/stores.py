"""Prepared stores and half-done trainings that were damaged before ``naisr train`` goes on with them."""

from __future__ import annotations

import io
import json
import pickle
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from corpus import checkpoints, damage
from corpus.case import OUT, Case, Damage, Ending, Expected, Files, Goods, Special
from numpy.random import Generator
from safetensors.numpy import load_file

OPTIONS = ("--config", "{goods}/small.toml", "--epochs")
NEW = ("train", "store", "--out", f"{OUT}/mine.safetensors", *OPTIONS, "1")
"""A training from nothing."""

MORE = ("train", "store", "--out", "mine.safetensors", *OPTIONS, "1")
"""The training that has ended, once more."""

ALL = ("surface.npy", "near.npy", "uniform.npy")


def trained(folder: Path) -> str:
    """What is wrong with the atlas that was written."""
    path = folder / OUT / "mine.safetensors"
    tensors = load_file(path if path.exists() else folder / "mine.safetensors")
    wrong = [name for name, tensor in tensors.items() if not np.isfinite(tensor).all()]
    return f"{wrong[0]} is not finite" if wrong else ""


def _files(goods: Goods) -> dict[str, bytes | Special]:
    return {f"store/{name}": content for name, content in goods.store.items()}


def _index(name: str, *damages: Damage, ending: Ending = "refused") -> Case:
    """The store's index, its bytes damaged."""

    def make(goods: Goods, rng: Generator) -> Files:
        files = _files(goods)
        content = goods.store["store.json"]
        for each in damages:
            content = each(content, rng)
        return {**files, "store/store.json": content}

    return Case("store", name, make, NEW, Expected(ending, trained))


def _record(name: str, change: Callable[[dict[str, Any]], object], ending: Ending = "refused") -> Case:
    """The store's index, something else in it."""

    def alter(content: bytes, _rng: Generator) -> bytes:
        record = json.loads(content)
        change(record)
        return json.dumps(record).encode()

    return _index(f"index: {name}", alter, ending=ending)


def _samples(
    name: str,
    change: Callable[[np.ndarray], Any],
    which: str = "surface.npy",
    ending: Ending = "refused",
    every: bool = True,
) -> Case:
    """The samples of the shapes, or of the first alone, changed."""

    def make(goods: Goods, _rng: Generator) -> Files:
        files = _files(goods)
        chosen = sorted(key for key in files if key.endswith(which))[: None if every else 1]
        for key in chosen:
            content = files[key]
            assert isinstance(content, bytes)
            changed = change(np.load(io.BytesIO(content)))
            files[key] = changed if isinstance(changed, bytes) else _npy(changed)
        return files

    return Case("store", f"{which}: {name}", make, NEW, Expected(ending, trained))


def _npy(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, array, allow_pickle=True)
    return file.getvalue()


def _bytes(name: str, *damages: Damage, which: str, ending: Ending = "refused") -> Case:
    """The bytes of such files of all shapes damaged."""

    def make(goods: Goods, rng: Generator) -> Files:
        files = _files(goods)
        for key in sorted(key for key in files if key.endswith(which)):
            content = files[key]
            assert isinstance(content, bytes)
            for each in damages:
                content = each(content, rng)
            files[key] = content
        return files

    return Case("store", f"{which} {name}", make, NEW, Expected(ending, trained))


def _without(name: str, *ends: str, ending: Ending = "refused") -> Case:
    """Without some of the files."""

    def make(goods: Goods, _rng: Generator) -> Files:
        return {key: content for key, content in _files(goods).items() if not key.endswith(ends)}

    return Case("store", name, make, NEW, Expected(ending, trained))


def _with(
    name: str, more: Mapping[str, bytes | Special], ending: Ending = "refused", words: Sequence[str] = NEW
) -> Case:
    """With more files, or others."""

    def make(goods: Goods, _rng: Generator) -> Files:
        return {**_files(goods), **more}

    return Case("store", name, make, tuple(words), Expected(ending, trained))


def _rotten() -> bytes:
    """What would make a file if it were believed."""

    class Evil:
        def __reduce__(self) -> tuple[Any, ...]:
            return (open, ("pwned", "w"))

    return pickle.dumps(Evil())


_put, _drop = checkpoints._put, checkpoints._drop
_STORES = [
    _index("as it is", ending="success"),
    *(_index(f"index cut at {share}", damage.cut(share)) for share in (0.05, 0.5, 0.98)),
    *(_index(f"index with flips {turn}", damage.flip(3), ending="either") for turn in "abcd"),
    *(
        _index(f"index: {what}", lambda _content, _rng, other=other: other)
        for what, other in damage.STRANGERS.items()
        if what != "a zip"
    ),
    _index("index: a hole", damage.hole(40)),
    _index("index: in UTF-16", damage.encoded("utf-16"), ending="either"),
    _index("index: nesting", lambda _content, _rng: b"[" * 100_000 + b"]" * 100_000),
    *(_record(f"version {version}", _put("version", value=version)) for version in (99, "abc", None, 1.5)),
    *(
        _record(f"{key} missing", _drop(key))
        for key in ("population", "frame", "alignment", "shapes", "name")
    ),
    *(
        _record(f"a scale of {value}", _put("frame", "scale_mm", value=value))
        for value in (0, -1.0, float("nan"), "wide")
    ),
    _record("a shape less", lambda record: record["shapes"].pop()),
    _record("a shape twice", lambda record: record["shapes"].__setitem__(1, record["shapes"][0]), "either"),
    _record("a way out", lambda record: record["shapes"].__setitem__(0, "../../etc")),
    _record("an absolute path", lambda record: record["shapes"].__setitem__(0, "/etc")),
    _record("no shapes", lambda record: record.update(shapes=[])),
    _record("a value of nan", _put("population", "values", 0, 0, value=float("nan"))),
    _record("a value of 1e308", _put("population", "values", 0, 0, value=1e308), "either"),
    _record("everybody held out", lambda record: record["population"].update(held_out=[True] * 8)),
    _record("nobody held out", lambda record: record["population"].update(held_out=[False] * 8), "success"),
    _record("a covariate of scale 0", _put("population", "covariates", 0, "scale", value=0.0)),
    _record("a list", lambda record: record.clear()),
    *(
        _samples(name, change, which)
        for which in ALL
        for name, change in (
            ("nan", lambda rows: np.full_like(rows, np.nan)),
            ("a column less", lambda rows: rows[:, :-1]),
            ("no rows", lambda rows: rows[:0]),
        )
    ),
    *(
        _samples(name, change)
        for name, change in (
            ("objects", lambda rows: rows.astype(object)),
            ("whole numbers", lambda rows: rows.astype(np.int32)),
            ("words", lambda rows: rows.astype("U8")),
            ("one dimension", np.ravel),
            ("flat", lambda rows: rows[0]),
            ("infinite", lambda rows: np.full_like(rows, np.inf)),
            ("complex", lambda rows: rows.astype(complex)),
            ("a pickle", lambda rows: _rotten()),
            ("an archive", lambda rows: b"PK\x03\x04" + rows.tobytes()),
        )
    ),
    _samples("doubles", lambda rows: rows.astype(np.float64), ending="either"),
    _samples("by columns", np.asfortranarray, ending="either"),
    _samples("big endian", lambda rows: rows.astype(">f4"), ending="either"),
    _samples("few rows", lambda rows: rows[:3], ending="either"),
    _samples("nan in one shape", lambda rows: np.full_like(rows, np.nan), every=False, ending="either"),
    _samples("a thousand times as far", lambda rows: rows * 1000, ending="either"),
    *(_bytes(f"cut at {share}", damage.cut(share), which="near.npy") for share in (0.03, 0.5, 0.99)),
    *(
        _bytes(
            f"with flips in the header {turn}", damage.flip(2, 0, 100), which="uniform.npy", ending="either"
        )
        for turn in "abc"
    ),
    _bytes("with flips", damage.flip(2, 128), which="surface.npy", ending="either"),
    _bytes("with more bytes", damage.ended_with(bytes(8)), which="near.npy", ending="either"),
    _bytes("cut", damage.cut(0.5), which="mesh.ply", ending="either"),
    _without("no surface samples", "surface.npy"),
    _without("no near samples", "near.npy"),
    _without("no meshes", "mesh.ply", ending="either"),
    _without("no report", "report.json", ending="success"),
    _without("no index", "store.json"),
    _without("an empty folder", ""),
    _with(
        "a stranger's file", {"store/notes.txt": b"by hand", "store/shapes/notes.txt": b"by hand"}, "success"
    ),
    _with("a folder for an index", {"store/store.json": Special.FOLDER}),
    _with(
        "out is a table",
        {"mine.csv": b"mesh,subject\n"},
        words=("train", "store", "--out", "mine.csv", *OPTIONS, "1"),
    ),
    _with("out is somebody's text", {"mine.safetensors": b"my notes"}, words=MORE),
    _with("out is a folder", {"mine.safetensors": Special.FOLDER}, words=MORE),
    _with(
        "out lies under a file",
        {"mine": b"my notes"},
        words=("train", "store", "--out", "mine/a.safetensors", *OPTIONS, "1"),
    ),
    _with("the training's folder is a file", {"mine.safetensors.training": b"my notes"}, words=MORE),
    _with(
        "a store that is a file",
        {"mine": b"my notes"},
        words=("train", "mine", "--out", f"{OUT}/a.safetensors", *OPTIONS, "1"),
    ),
]


def _state(
    name: str,
    *damages: Damage,
    ending: Ending = "refused",
    words: Sequence[str] = MORE,
    more: Mapping[str, bytes | Special | None] | None = None,
) -> Case:
    """The state that a training goes on from, damaged."""

    def make(goods: Goods, rng: Generator) -> Files:
        content = goods.training["mine.safetensors.training/state.pt"]
        for each in damages:
            content = each(content, rng)
        training = {key: value for key, value in goods.training.items() if "tensorboard" not in key}
        files = {**_files(goods), **training, "mine.safetensors.training/state.pt": content, **(more or {})}
        return {key: value for key, value in files.items() if value is not None}

    return Case("state", name, make, tuple(words), Expected(ending, trained))


def _torch(change: Callable[[dict[str, Any]], object]) -> Damage:
    """What is in the state changed."""

    def damage(content: bytes, _rng: Generator) -> bytes:
        import torch

        record = torch.load(io.BytesIO(content), weights_only=True)
        change(record)
        file = io.BytesIO()
        torch.save(record, file)
        return file.getvalue()

    return damage


def _everywhere(value: float, record: Any) -> None:
    """Every number of every tensor."""
    import torch

    for each in record.values() if isinstance(record, dict) else record:
        if isinstance(each, torch.Tensor) and each.is_floating_point():
            each.fill_(value)
        elif isinstance(each, dict | list):
            _everywhere(value, each)


LONGER = (*MORE[:-1], "2")
_STATES = [
    _state("as it is", ending="success"),
    *(_state(f"cut at {share}", damage.cut(share)) for share in (0.02, 0.5, 0.95)),
    *(
        _state(f"{count} flips {turn}", damage.flip(count), ending="either")
        for count, turn in ((1, "a"), (1, "b"), (10, "a"), (10, "b"), (300, "a"))
    ),
    _state("a hole", damage.hole(100)),
    _state("zeros within", damage.zeros(1500), ending="either"),
    _state("twice", damage.doubled, ending="either"),
    *(_state(what, lambda _content, _rng, other=other: other) for what, other in damage.STRANGERS.items()),
    _state("a pickle that would make a file", lambda _content, _rng: _rotten()),
    _state("a list", lambda _content, _rng: pickle.dumps([1, 2])),
    _state("packed", damage.gzipped),
    _state("nothing in it", _torch(lambda record: record.clear())),
    _state("no fingerprint", _torch(lambda record: record.pop("fingerprint"))),
    _state("another fingerprint", _torch(lambda record: record.update(fingerprint="0" * 64))),
    _state("nan weights", _torch(lambda record: _everywhere(float("nan"), record))),
    _state("infinite weights", _torch(lambda record: _everywhere(float("inf"), record))),
    *(
        _state(
            f"iteration {value}",
            _torch(_put("iteration", value=value)),
            ending="refused",
        )
        for value in (-5, "many", None, 2.5)
    ),
    _state("a folder", more={"mine.safetensors.training/state.pt": Special.FOLDER}),
    _state(
        "what a killed program left",
        more={"mine.safetensors.training/.state.abcd1234.pt": b"half"},
        ending="success",
    ),
    _state("without the atlas", more={"mine.safetensors": None}, ending="success"),
    _state("without the state", more={"mine.safetensors.training/state.pt": None}, ending="either"),
    _state("another seed", words=(*MORE, "--seed", "5")),
    _state("another preset", words=(*MORE[:4], "--preset", "deepsdf-demo", "--epochs", "1")),
    _state("an atlas that is cut", more={"mine.safetensors": b"\x10\0\0\0\0\0\0\0{"}, ending="either"),
]
CASES = (*_STORES, *_STATES)
