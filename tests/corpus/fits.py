"""What the kinds of input have in common that are brought to a fit."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from functools import partial
from pathlib import Path

from corpus.case import RECORD, Case, Damage, Ending, Expected, Files, Goods, Special, single, within
from numpy.random import Generator

KNOWN = ("--known", "age=6,sex=M")
FAR_MM = 1.0
"""Mean distance to the fitted surface that no egg has that was read as it is."""


def fitting(file: str, *more: str) -> tuple[str, ...]:
    """The words that fit a file and keep the figures."""
    return ("fit", file, "--atlas", "{goods}/atlas.safetensors", *KNOWN, "--json", RECORD, *more)


def has_volume(folder: Path, *, truth_cm3: float, told: bool) -> str:
    """What is wrong with the patient's volume; ``told`` where there has to be one."""
    volume = _record(folder)["patient"]["volume_cm3"]
    if volume is None:
        return "the shape has no volume of its own" if told else ""
    if not within(0.02, volume, truth_cm3):
        return f"{volume:.2f} cm³ instead of {truth_cm3:.2f}"
    return ""


def is_part(folder: Path) -> str:
    """What is wrong with a shape that is open or a cloud, and lies on the atlas's."""
    record = _record(folder)
    if (volume := record["patient"]["volume_cm3"]) is not None:
        return f"an open shape has {volume:.2f} cm³"
    if not record["residual_mm"] < FAR_MM:
        return f"it lies {record['residual_mm']:.2f} mm from its fit"
    return ""


def _record(folder: Path) -> dict:
    record: dict = json.loads((folder / RECORD).read_text())
    assert all(math.isfinite(record[key]) for key in ("residual_mm", "volume_cm3"))
    return record


def whole(truth_cm3: float, ending: Ending = "success", says: str = "") -> Expected:
    """A shape that bounds a body of such a volume; in either case none may be told, but not a wrong one."""
    return Expected(ending, partial(has_volume, truth_cm3=truth_cm3, told=ending == "success"), says)


def part(ending: Ending = "success", says: str = "") -> Expected:
    """An open surface or a cloud."""
    return Expected(ending, is_part, says)


def case(
    kind: str,
    name: str,
    file: str,
    good: Callable[[], bytes],
    expected: Expected,
    *damages: Damage,
    words: tuple[str, ...] = (),
) -> Case:
    """A damaged file that is fitted; ``words`` are more of the command's."""
    return Case(kind, name, single(file, good, *damages), fitting(file, *words), expected)


def special(kind: str, what: Special, file: str, expected: Expected) -> Case:
    """What is no file under the name of one."""

    def make(_goods: Goods, _rng: Generator) -> Files:
        return {file: what}

    return Case(kind, f"a {what.value} named {file}", make, fitting(file), expected)
