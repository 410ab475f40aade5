"""Options that several commands share, and how the text after an option is read."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import CoercionError, Parameter, convert

from naisr_model.errors import InputError
from naisr_model.files import checked_place

AtlasFile = Annotated[Path, Parameter(help="the .safetensors file.")]
WHOLE = r"[+-]?[0-9]{1,18}"
DECIMAL = r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,3})?"


def converted(kind: Any, tokens: Sequence[Any]) -> Any:
    """The words after an option as a value: where a whole number is wanted, 12.5 is none.

    Raises:
        CoercionError: for what is of another kind.
    """
    return convert(kind, tokens, converter=_converted)


def _converted(kind: Any, word: str) -> Any:
    if kind is int and not re.fullmatch(WHOLE, word):
        raise CoercionError(msg=f"'{word}' is no whole number; write digits only, as 128")
    if kind is float and not (re.fullmatch(DECIMAL, word) and math.isfinite(float(word))):
        raise CoercionError(msg=f"'{word}' is no finite number; write it as 12.5")
    return convert(kind, [word])


def _require_place(_kind: Any, path: Path | None) -> None:
    """Refuse what is no place for a file before hours of work have nowhere to go."""
    if path is not None:
        checked_place(path)


def _require_figures(_kind: Any, path: Path | None) -> None:
    """The same of a place for figures, and what holds something else."""
    if path is not None and checked_place(path).exists():
        try:
            json.loads(path.read_bytes() or b"{}")
        except (OSError, ValueError) as error:
            raise InputError(f"{path} is there and holds no figures; give another file") from error


def _require_folder(_kind: Any, path: Path | None) -> None:
    """The same where a folder is wanted."""
    if path is not None and path.exists() and not path.is_dir():
        raise InputError(f"'{path}' is a file; give the name of a folder to write into")


FileToWrite = Annotated[Path, Parameter(validator=_require_place)]
FolderToWrite = Annotated[Path, Parameter(validator=_require_folder)]
JsonFile = Annotated[
    Path | None,
    Parameter(name="--json", help="also write the figures to this file.", validator=_require_figures),
]


ClusterAddress = Annotated[
    str | None,
    Parameter(
        name="--cluster",
        help="address of a dask scheduler whose workers share the work, as tcp://node17:8786; or local:4.",
    ),
]


def seconds(text: str) -> float:
    """``90s``, ``45m`` or ``1.5h`` in seconds.

    Raises:
        InputError: for anything else.
    """
    factor = {"s": 1.0, "m": 60.0, "h": 3600.0}.get(text[-1:], 0.0)
    try:
        duration = factor * float(text[:-1])
    except ValueError:
        duration = 0.0
    if not 0 < duration < math.inf:
        raise InputError(f"the time budget is '{text}'; write it as 90s, 45m or 1.5h")
    return duration
