"""What a case of the corpus is: files made from good ones, a command on them, and how that has to end."""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.random import Generator

SEED = 0
"""Of everything that is drawn: the same seed gives the same files."""

OUT = "out"
"""The folder that a case's command writes into, beside its input."""

RECORD = f"{OUT}/record.json"


class Special(Enum):
    """What may lie where a file is meant."""

    FOLDER = "folder"
    PIPE = "pipe"
    LOOP = "loop"
    """A link to itself."""


Files = Mapping[str, bytes | Special]
"""What lies in a case's folder, by the path there."""

Damage = Callable[[bytes, Generator], bytes]
Ending = Literal["success", "refused", "either"]


@dataclass(frozen=True)
class Goods:
    """Good inputs, which damaged ones are made from.

    Attributes:
        folder: where ``atlas.safetensors``, ``marked.safetensors`` (the same, aligned by landmarks) and
            ``small.toml`` lie; ``{goods}`` in the words of a case stands for it.
        table: a table of eggs, their meshes and landmarks.
        store: the same prepared.
        training: an atlas that was trained on that for an epoch, and the state to go on from.
    """

    folder: Path
    table: Mapping[str, bytes]
    store: Mapping[str, bytes]
    training: Mapping[str, bytes]

    @property
    def atlas(self) -> bytes:
        """The file of the atlas."""
        return (self.folder / "atlas.safetensors").read_bytes()


def nothing(_folder: Path) -> str:
    """No result that could be wrong."""
    return ""


@dataclass(frozen=True)
class Expected:
    """How a command has to end.

    Attributes:
        ending: in success, in one sentence with exit code 2, or in either.
        check: of a success, what is wrong with the results in a case's folder; empty where nothing is.
        says: what a success has to speak of, a regular expression.
    """

    ending: Ending
    check: Callable[[Path], str] = nothing
    says: str = ""


REFUSED = Expected("refused")


@dataclass(frozen=True)
class Case:
    """One trial of the corpus.

    Attributes:
        kind: of input.
        name: of the case, unlike any other of its kind.
        make: the files of the case from the good ones; draws from the generator that it is given.
        words: what stands after ``naisr``; for the window the file to open.
        expected: how it has to end.
        program: the command, or the window that opens a scan, an atlas or a session.
    """

    kind: str
    name: str
    make: Callable[[Goods, Generator], Files]
    words: tuple[str, ...]
    expected: Expected
    program: Literal["naisr", "scan", "atlas", "session"] = "naisr"

    @property
    def id(self) -> str:
        """Kind and name."""
        return f"{self.kind}-{self.name}".replace(" ", "_")

    def files(self, goods: Goods) -> Files:
        """The files of the case, the same every time."""
        return self.make(goods, np.random.default_rng([SEED, zlib.crc32(self.id.encode())]))


def place(files: Files, folder: Path) -> None:
    """Write the files of a case."""
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if isinstance(content, bytes):
            path.write_bytes(content)
        else:
            _place_special(content, path)


def _place_special(what: Special, path: Path) -> None:
    if what is Special.FOLDER:
        path.mkdir()
    elif what is Special.PIPE:
        os.mkfifo(path)
    else:
        path.symlink_to(path.name)


def single(name: str, good: Callable[[], bytes], *damages: Damage) -> Callable[[Goods, Generator], Files]:
    """One file: good bytes, and what is done to them in turn."""

    def make(_goods: Goods, rng: Generator) -> Files:
        content = good()
        for damage in damages:
            content = damage(content, rng)
        return {name: content}

    return make


def within(relative: float, got: Any, truth: Any) -> bool:
    """Whether numbers agree to a share of the truth."""
    return bool(np.allclose(np.asarray(got, float), np.asarray(truth, float), rtol=relative, atol=1e-9))
